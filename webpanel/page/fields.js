/** The session's input fields, which the live view and a recording's view both have. */

import { make } from "./dom.js";
import { t } from "./i18n.js";

/** @typedef {import("./types.js").SessionFields} SessionFields */
/** @typedef {keyof SessionFields} Name */

const LONGEST_LINE = 200;
const LONGEST_TEXT = 4000;

/** @type {Name[]} */
export const NAMES = ["bib", "athlete", "gate", "wind", "operator", "notes"];
/** Fields for which a phone shall show digits. */
const NUMERIC = ["bib", "gate"];

/**
 * @param {HTMLElement} place
 * @param {string} prefix makes ids of several forms differ
 * @param {(name: Name, value: string) => void} changed called when a field is left with another value
 */
export function makeFields(place, prefix, changed) {
  for (const name of NAMES) {
    const long = name === "notes";
    const input = make(long ? "textarea" : "input", {
      id: `${prefix}-${name}`, name, maxLength: long ? LONGEST_TEXT : LONGEST_LINE, autocomplete: "off", spellcheck: false,
      ...(long ? { rows: 2 } : { type: "text", inputMode: NUMERIC.includes(name) ? "numeric" : "text", enterKeyHint: "done" }),
      onchange: () => changed(name, input.value.trim()),
    });
    place.append(make("label", { class: `field-${name}` }, make("span", { "data-t": `field.${name}` }, t(`field.${name}`)), input));
  }
}

/**
 * @param {HTMLFormElement} form
 * @returns {SessionFields}
 */
export function readFields(form) {
  return /** @type {SessionFields} */ (Object.fromEntries(NAMES.map((name) => [name, inputOf(form, name).value.trim()])));
}

/**
 * Fill in, but leave alone what somebody is writing in.
 *
 * @param {HTMLFormElement} form
 * @param {Partial<SessionFields>} values
 */
export function writeFields(form, values) {
  for (const [name, value] of Object.entries(values)) {
    const input = inputOf(form, name);
    if (input !== document.activeElement && input.value !== value) input.value = value;
  }
}

/**
 * @param {HTMLFormElement} form
 * @param {string} name
 * @returns {HTMLInputElement}
 */
export function inputOf(form, name) {
  return /** @type {HTMLInputElement} */ (form.elements.namedItem(name));
}
