/**
 * Jumps as a table for a spreadsheet: UTF-8 with a byte order mark, semicolons, decimal commas. A Norwegian Excel opens
 * that right with a double click; others are told it when they import it.
 */

import { t } from "../i18n/i18n.js";
import { make } from "../shared/dom.js";
import { levelOf, MARKS, verdictOf } from "../shared/figures.js";
import { dayOf, FIGURES, figureOf } from "./figures.js";

/** @typedef {import("./types.js").AthleteJump} AthleteJump */

/** So many digits are given of a number; its standard deviation says how many of them tell something. */
const DIGITS = 4;

/** @param {AthleteJump[]} jumps */
export function csvOf(jumps) {
  const heading = [
    ...["athletes.date", "athletes.time", "field.bib", "field.athlete", "field.gate", "athletes.recording", "athletes.number"].map((key) => t(key)),
    ...FIGURES.flatMap(({ name, unit }) => [`${t(`measured.${name}`)} (${unit})`, `${t("athletes.sigma")} (${unit})`]),
    t("athletes.level"), t("athletes.verdict"),
  ];
  const rows = jumps.map((each) => [
    dayOf(each.jump.time), new Date(each.jump.time).toTimeString().slice(0, 8), each.bib, each.athlete, each.gate, each.jump.recording, String(each.jump.jump),
    ...FIGURES.flatMap(({ name }) => { const found = figureOf(each, name); return [figure(found?.value), figure(found?.sigma)]; }),
    t(MARKS[levelOf(each.jump, each.level === "info")]), verdictOf(each.jump),
  ]);
  return `\ufeff${[heading, ...rows].map((row) => row.map(cell).join(";")).join("\r\n")}\r\n`;
}

/** @param {number} [value] */
function figure(value) {
  return value === undefined ? "" : value.toFixed(DIGITS).replace(".", ",");
}

/**
 * A cell that no spreadsheet takes for a formula.
 *
 * @param {string} text
 */
function cell(text) {
  const plain = /^[=+@\t]|^-(?!\d)/.test(text) ? `'${text}` : text;
  return /[;"\r\n]/.test(plain) ? `"${plain.replaceAll('"', '""')}"` : plain;
}

/**
 * Have the browser keep a text as a file.
 *
 * @param {string} text
 * @param {string} name
 */
export function keep(text, name) {
  const address = URL.createObjectURL(new Blob([text], { type: "text/csv;charset=utf-8" }));
  make("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address));
}
