/** Translates the page. What the service says comes in English with a code, by which it is translated here. */

import { bring } from "../shared/loading.js";
import { load, save } from "../shared/store.js";

/** @typedef {import("../shared/types.js").Statement} Statement */
/** @typedef {import("../shared/types.js").Values} Values */

/** Words by language, as far as they were needed. @type {Record<string, Record<string, string>>} */
const WORDS = { en: {}, nb: {} };
/** Text and advice by code: what the service says is in English. @type {Record<string, Record<string, [string, string?]>>} */
const STATEMENTS = { en: {}, nb: {} };
/** What of a language is there: sets of words, and the statements ("said"). @type {Record<string, Set<string>>} */
const there = { en: new Set(["said"]), nb: new Set() };
/** The sets of words that the page has needed in any language; "": those of what is around the views. */
const needed = new Set(["", "said"]);

/** @type {"en"|"nb"} */
let language = "en";

/**
 * The language chosen last, else the browser's; Norwegian of any kind reads bokmål.
 *
 * @param {...string} sets of words beside those of what is around the views: NAME of en-NAME.js
 */
export async function startLanguage(...sets) {
  const browsers = /^(nb|nn|no)\b/i.test(navigator.language) ? "nb" : "en";
  language = load("language", browsers) === "nb" ? "nb" : "en";
  await needWords(...sets);
}

/**
 * Load sets of words in the language in use, and put them into the page.
 *
 * @param {...string} sets
 * @throws {import("../shared/api.js").Problem} they do not come
 */
export async function needWords(...sets) {
  for (const name of sets) needed.add(name);
  await loadWords(language);
  translate();
}

/**
 * @param {string} name of a language
 * @throws {import("../shared/api.js").Problem} its words do not come
 */
export async function chooseLanguage(name) {
  const chosen = name === "nb" ? "nb" : "en";
  await loadWords(chosen);
  save("language", chosen);
  language = chosen;
  translate();
}

/** @param {"en"|"nb"} name */
async function loadWords(name) {
  await Promise.all([...needed].filter((set) => !there[name].has(set)).map(async (set) => {
    const { words = {}, said = {} } = await bring(() => import(`./${set ? `${name}-${set}` : name}.js`));
    Object.assign(WORDS[name], words);
    Object.assign(STATEMENTS[name], said);
    there[name].add(set);
  }));
}

/** Write the words that are there into the page. */
function translate() {
  document.documentElement.lang = language;
  for (const [attribute, put] of /** @type {[string, (e: Element, words: string) => void][]} */ ([
    ["data-t", (element, words) => { element.textContent = words; }],
    ["data-t-label", (element, words) => { element.setAttribute("aria-label", words); if (element.matches("button, a")) element.setAttribute("title", words); }],
    ["data-t-placeholder", (element, words) => element.setAttribute("placeholder", words)],
  ])) {
    for (const element of document.querySelectorAll(`[${attribute}]`)) {
      const key = element.getAttribute(attribute) ?? "";
      if (Object.hasOwn(WORDS[language], key)) put(element, t(key)); // of a part that was not shown yet there are none
    }
  }
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
  const words = WORDS[language][key];
  if (words === undefined) throw new Error(`no words for "${key}" are loaded in ${language}`);
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
