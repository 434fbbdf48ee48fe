/** Which jump of the recording shown is looked at, where it has several: a choice for kinogram, figures, pictures and comparison. */

import { t } from "../i18n/i18n.js";
import { $, icon, make } from "../shared/dom.js";

/** A measured jump to choose. @typedef {{ number: number, level: string }} Choice */

/** @type {Choice[]} */
let choices = [];
let wanted = 1;
/** Called whenever another jump is looked at. @type {(() => void)[]} */
const whenChosen = [];

/**
 * A recording is shown, or another jump of it by its address.
 *
 * @param {number} jump its number
 */
export function enterJumps(jump) {
  wanted = jump;
  offerJumps([]);
}

/**
 * Offer the measured jumps.
 *
 * @param {Choice[]} measured in order
 */
export function offerJumps(measured) {
  if (JSON.stringify(measured) === JSON.stringify(choices)) return;
  const before = jumpShown();
  choices = measured;
  drawJumps();
  if (choices.length && jumpShown() !== before) whenChosen.forEach((action) => action());
}

/** @param {() => void} action called whenever another jump is looked at */
export function onJump(action) {
  whenChosen.push(action);
}

/** Number of the jump that is looked at. */
export function jumpShown() {
  return choices.length && !choices.some(({ number }) => number === wanted) ? choices[0].number : wanted;
}

/** Draw the choice, perhaps in another language. */
export function drawJumps() {
  $("jump-choice").hidden = choices.length < 2;
  $("jump-choice").replaceChildren(...choices.map(({ number, level }) => make(
    "button", { type: "button", "aria-pressed": String(number === jumpShown()), "data-level": level, onclick: () => choose(number) },
    icon(level), make("span", {}, t("jump.number", { jump: number })),
  )));
  const row = $("jump-choice"), shown = row.querySelector('[aria-pressed="true"]');
  if (shown) row.scrollLeft = shown.offsetLeft - row.offsetLeft - (row.clientWidth - shown.clientWidth) / 2; // the page stays
}

/** @param {number} number */
function choose(number) {
  if (number === jumpShown()) return;
  wanted = number;
  const at = choices.findIndex((each) => each.number === number);
  drawJumps();
  /** @type {HTMLElement} */ ($("jump-choice").children[at]).focus({ preventScroll: true });
  whenChosen.forEach((action) => action());
}
