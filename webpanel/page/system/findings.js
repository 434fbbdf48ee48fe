/** Findings of the doctor and of a rehearsal as a list: PASS, WARN or FAIL, what was found, and what to do. */

import { say, t } from "../i18n/i18n.js";
import { icon, make } from "../shared/dom.js";

/** @typedef {import("../shared/types.js").Finding} Finding */

/** Level of the page by that of the finding, the gravest last. */
export const LEVELS = { PASS: "good", WARN: "warning", FAIL: "error" };

/**
 * Make the list, the gravest first.
 *
 * @param {Finding[]} findings
 */
export function makeFindings(findings) {
  const graveFirst = [...findings].sort((a, b) => gravity(b) - gravity(a));
  return make("ul", { class: "findings" }, ...graveFirst.map(makeFinding));
}

/** @param {Finding} finding */
function gravity({ level }) {
  return Object.keys(LEVELS).indexOf(level);
}

/** @param {Finding} finding */
function makeFinding({ level, topic, code, what, remedy, values }) {
  const { text, advice } = say({ code, text: what, advice: remedy, values });
  return make("li", { class: "finding", "data-level": LEVELS[level] }, icon(LEVELS[level]),
    make("div", {}, make("p", {}, make("strong", {}, `${t(`doctor.mark_${level}`)} `), make("span", { class: "topic" }, t(`doctor.${topic}`))), make("p", {}, text), remedy ? make("p", { class: "advice" }, advice) : null));
}
