/** The input fields of a session (bib, athlete, …), which the live view and the view of a recording both have. */

import { t } from "../i18n/i18n.js";
import { make } from "./dom.js";

/** @typedef {import("./types.js").SessionFields} SessionFields */
/** @typedef {keyof SessionFields} Name */

const LONGEST_LINE = 200;
const LONGEST_TEXT = 4000;

/** @type {Name[]} */
const NAMES = ["bib", "athlete", "gate", "wind", "operator", "notes"];
/** Fields for which a phone shows its keyboard of digits. */
const NUMERIC = ["bib", "gate"];

/**
 * Put the input fields into a form.
 *
 * @param {HTMLFormElement} form
 * @param {string} prefix makes ids of several forms differ
 * @param {(name: Name, value: string) => void} changed called when a field is left with another value
 */
export function makeFields(form, prefix, changed) {
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    /** @type {HTMLElement} */ (document.activeElement).blur();
  });
  for (const name of NAMES) {
    const long = name === "notes";
    const input = make(long ? "textarea" : "input", {
      id: `${prefix}-${name}`, name, maxLength: long ? LONGEST_TEXT : LONGEST_LINE, autocomplete: "off", spellcheck: false,
      ...(long ? { rows: 2 } : { type: "text", inputMode: NUMERIC.includes(name) ? "numeric" : "text", enterKeyHint: "done" }),
      onchange: () => changed(name, input.value.trim()),
    });
    form.querySelector(".fields")?.append(make("label", { class: `field-${name}` }, make("span", { "data-t": `field.${name}` }, t(`field.${name}`)), input));
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
 * Fill in values, except into the field that has the focus: somebody is writing in it.
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
