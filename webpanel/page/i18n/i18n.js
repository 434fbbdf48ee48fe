/** Translates the page. What the service says comes in English with a code, by which it is translated here. */

import { load, save } from "../shared/store.js";
import { en } from "./en.js";
import { analysis as nbAnalysis } from "./nb-analysis.js";
import { digitizing as nbDigitizing } from "./nb-digitizing.js";
import { events as nbEvents } from "./nb-events.js";
import { files as nbFiles } from "./nb-files.js";
import { findings as nbFindings } from "./nb-findings.js";
import { refusals as nbRefusals } from "./nb-refusals.js";
import { statements as nbStatements } from "./nb-statements.js";
import { targets as nbTargets } from "./nb-targets.js";
import { nb } from "./nb.js";

/** @typedef {import("../shared/types.js").Statement} Statement */
/** @typedef {import("../shared/types.js").Values} Values */

const LANGUAGES = { en, nb };
/** @type {Record<string, Record<string, [string, string?]>>} text and advice by code */
const STATEMENTS = { en: {}, nb: { ...nbStatements, ...nbFindings, ...nbEvents, ...nbAnalysis, ...nbRefusals, ...nbDigitizing, ...nbTargets, ...nbFiles } };

/** @type {"en"|"nb"} */
let language = "en";

/** The language chosen last, else the browser's; Norwegian of any kind reads bokmål. */
export function startLanguage() {
  const browsers = /^(nb|nn|no)\b/i.test(navigator.language) ? "nb" : "en";
  setLanguage(load("language", browsers));
}

/** @param {string} name */
function setLanguage(name) {
  language = name === "nb" ? "nb" : "en";
  document.documentElement.lang = language;
  for (const [attribute, put] of /** @type {[string, (e: Element, words: string) => void][]} */ ([
    ["data-t", (element, words) => { element.textContent = words; }],
    ["data-t-label", (element, words) => { element.setAttribute("aria-label", words); if (element.matches("button, a")) element.setAttribute("title", words); }],
    ["data-t-placeholder", (element, words) => element.setAttribute("placeholder", words)],
  ])) {
    for (const element of document.querySelectorAll(`[${attribute}]`)) put(element, t(element.getAttribute(attribute) ?? ""));
  }
}

/** @param {string} name */
export function chooseLanguage(name) {
  save("language", name);
  setLanguage(name);
}

/** The language in use: "en" or "nb". */
export function languageInUse() {
  return language;
}

/**
 * The words for `key`, with `{name}` filled in.
 *
 * @param {string} key
 * @param {Values} [values]
 */
export function t(key, values = {}) {
  const words = /** @type {Record<string, string>} */ (LANGUAGES[language])[key];
  if (words === undefined) throw new Error(`i18n/${language}.js has no "${key}"`);
  return fill(words, values);
}

/**
 * What the service says in the operator's language; in English where the translation is missing.
 *
 * @param {{ code: string, text: string, advice?: string, values?: Values }} said
 * @returns {{ text: string, advice: string }}
 */
export function say({ code, text, advice = "", values = {} }) {
  if (!Object.hasOwn(STATEMENTS[language], code)) return { text, advice }; // a stranger's log may name anything
  const translated = STATEMENTS[language][code];
  const names = [...translated.join(" ").matchAll(/\{(\w+)\}/g)].map((match) => match[1]);
  if (names.some((name) => values[name] === undefined)) return { text, advice };
  return { text: fill(translated[0], values), advice: fill(translated[1] ?? "", values) };
}

/**
 * @param {string} words
 * @param {Values} values
 */
function fill(words, values) {
  return words.replace(/\{(\w+)\}/g, (_, name) => {
    const value = values[name];
    if (typeof value === "object") return say(value).text;
    return typeof value === "number" ? value.toLocaleString(language, digits(value)) : String(value);
  });
}

/**
 * How many digits are said of a number: one after the point, or, of what is less than one, the first two.
 *
 * @param {number} value
 * @returns {Intl.NumberFormatOptions}
 */
function digits(value) {
  return Math.abs(value) < 1 ? { maximumSignificantDigits: 2 } : { maximumFractionDigits: 1 };
}
