/** When a recording goes on in its next part: changed from the next one on, kept in the rig file. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { attempt, tell } from "../shared/snacks.js";

/** @typedef {"part_s"|"part_gb"} Limit */
/** @typedef {{part_s: number|null, part_gb: number|null, saved: boolean}} PartsView */

/** @type {Limit[]} */
const LIMITS = ["part_s", "part_gb"];

/** @type {PartsView|null} */
let found = null;
let changing = false;

export function startParts() {
  for (const limit of LIMITS) field(limit).addEventListener("input", drawParts);
  $("parts-form").addEventListener("submit", (/** @type {Event} */ event) => {
    event.preventDefault();
    void take(wanted());
  });
  $("parts-save").addEventListener("click", () => void take({ save: true }));
}

/** The view is entered: somebody else may have changed them. */
export async function enterParts() {
  const answer = await attempt(() => call("GET", "parts"));
  if (answer) enter(answer);
}

export function drawParts() {
  const locked = !found || changing;
  for (const limit of LIMITS) field(limit).disabled = locked;
  $("parts-use").disabled = locked || same();
  $("parts-save").disabled = locked || (found?.saved ?? true);
  setText($("parts-said"), !found ? "" : !same() ? t("parts.not_yet") : t(found.saved ? "light.saved" : "light.unsaved"));
}

/** @param {{part_s?: number|null, part_gb?: number|null, save?: boolean}} change */
async function take(change) {
  if (changing) return; // a double tap
  changing = true;
  drawParts();
  await attempt(async () => {
    enter(await call("PATCH", "parts", change));
    if (change.save) tell("good", t("parts.kept"));
  });
  changing = false;
  drawParts();
}

/** @param {PartsView} answer */
function enter(answer) {
  found = answer;
  for (const limit of LIMITS) field(limit).value = answer[limit] === null ? "" : String(answer[limit]);
  drawParts();
}

/** @returns {Record<Limit, number|null>} what stands in the fields; an empty one sets no limit */
function wanted() {
  const value = (/** @type {Limit} */ limit) => field(limit).value === "" ? null : field(limit).valueAsNumber;
  return { part_s: value("part_s"), part_gb: value("part_gb") };
}

function same() {
  const now = wanted();
  return LIMITS.every((limit) => now[limit] === found?.[limit] && !field(limit).validity.badInput);
}

/**
 * @param {Limit} limit
 * @returns {HTMLInputElement}
 */
function field(limit) {
  return $(`parts-${limit}`);
}
