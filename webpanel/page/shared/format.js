/** Writes numbers, times and sizes for people, in their language. */

import { languageInUse, t } from "../i18n/i18n.js";

/** What writes numbers and times, by language and kind: to make one takes a hundred times as long as to write with it. @type {Map<string, Intl.NumberFormat|Intl.DateTimeFormat>} */
const writers = new Map();

/**
 * @template {Intl.NumberFormat|Intl.DateTimeFormat} Writer
 * @param {string} kind
 * @param {(language: string) => Writer} make
 * @returns {Writer}
 */
function writer(kind, make) {
  const key = `${languageInUse()} ${kind}`;
  const known = writers.get(key) ?? make(languageInUse());
  writers.set(key, known);
  return /** @type {Writer} */ (known);
}

/**
 * @param {number} value
 * @param {number} [digits] after the decimal point
 */
export function number(value, digits = 0) {
  return writer(`number ${digits}`, (language) => new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits, signDisplay: "negative" })).format(value);
}

/**
 * @param {Date} time
 * @param {Intl.DateTimeFormatOptions} how
 */
export function timeInWords(time, how) {
  return writer(JSON.stringify(how), (language) => new Intl.DateTimeFormat(language, how)).format(time);
}

/**
 * @param {number|null} value
 * @param {number} digits
 * @param {string} unit
 */
export function quantity(value, digits, unit) {
  return value === null ? "–" : `${number(value, digits)}\u202f${unit}`;
}

/** @param {number} seconds e.g. 72 becomes 1:12 */
export function clock(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const rest = String(whole % 60).padStart(2, "0");
  const minutes = Math.floor(whole / 60) % 60;
  const hours = Math.floor(whole / 3600);
  return hours ? `${hours}:${String(minutes).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}

/**
 * How long a recording lasts: one of a jump alone is over within seconds.
 *
 * @param {number} seconds
 */
export function length(seconds) {
  return seconds < 10 ? quantity(seconds, 1, "s") : clock(seconds);
}

/** @param {number} bytes */
export function size(bytes) {
  return bytes < 1e9 ? quantity(bytes / 1e6, 0, "MB") : quantity(bytes / 1e9, 1, "GB");
}

/** @param {string|number} time ISO text or ms */
export function timeOfDay(time) {
  return timeInWords(new Date(time), { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });
}

/** @param {string} time ISO text */
export function timeOfMinute(time) {
  return timeInWords(new Date(time), { hour: "2-digit", minute: "2-digit", hourCycle: "h23" });
}

/** @param {string} time ISO text */
export function day(time) {
  const then = new Date(time);
  if (then.toDateString() === new Date().toDateString()) return t("today");
  return timeInWords(then, { weekday: "long", day: "numeric", month: "long", year: "numeric" });
}

/**
 * Bib and name, or what there is of them.
 *
 * @param {{ bib: string, athlete: string }} session
 * @param {string} otherwise when there is neither
 */
export function who({ bib, athlete }, otherwise) {
  return [bib, athlete].filter(Boolean).join(" · ") || otherwise;
}
