/** "Better than chance?": two days or spans of an athlete's jumps, compared by the service with the test of `svev compare`. */

import { say, t } from "../i18n/i18n.js";
import { call, Problem } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { place } from "../shared/router.js";
import { tell, tellProblem } from "../shared/snacks.js";
import { spanOf } from "./figures.js";

/** @typedef {import("./types.js").Comparison} Comparison */

/** The service gives up after a minute. */
const DEADLINE_MS = 70_000;
/** Fewer jumps than so many know the athlete's scatter badly. */
const FEW = 8;
const FIELDS = ["first-from", "first-to", "second-from", "second-to"];
const [DEGREE, LENGTH, SPEED] = ["°", "m", "m/s"];
/** Unit and digits of each quantity, in the order in which they are shown. @type {Record<string, [string, number]>} */
const QUANTITIES = {
  speed: [SPEED, 2], height: [LENGTH, 3], alpha: [DEGREE, 1], beta: [DEGREE, 1], angle_of_attack: [DEGREE, 1], phi: [DEGREE, 1], gamma: [DEGREE, 1], dphi: [DEGREE, 1],
  velocity_x: [SPEED, 2], velocity_y: [SPEED, 2], velocity_z: [SPEED, 2],
};

/** @type {Comparison|null} */
let found = null;
/** Whose spans they are. */
let athlete = "";
let asking = false;

export function startSpans() {
  $("spans").addEventListener("submit", (/** @type {Event} */ event) => { event.preventDefault(); void compare(); });
  for (const field of FIELDS) $(`spans-${field}`).addEventListener("change", () => { found = null; drawSpans(); });
}

/**
 * Offer the last two days of an athlete, unless somebody has chosen others.
 *
 * @param {string[]} days newest first
 */
export function offerSpans(days) {
  for (const field of FIELDS) [$(`spans-${field}`).min, $(`spans-${field}`).max] = [days[days.length - 1], days[0]];
  if (athlete === place().id) return;
  athlete = place().id;
  found = null;
  const [second, first = second] = days;
  FIELDS.forEach((field, index) => { $(`spans-${field}`).value = index < 2 ? first : second; });
}

async function compare() {
  if (asking) return;
  const [first, second] = [spanOf($("spans-first-from").value, $("spans-first-to").value), spanOf($("spans-second-from").value, $("spans-second-to").value)];
  if (first.since < second.until && second.since < first.until) return tell("warning", t("spans.overlap"));
  const whose = athlete;
  const query = new URLSearchParams({ athlete, first_since: first.since, first_until: first.until, second_since: second.since, second_until: second.until });
  [asking, found] = [true, null];
  drawSpans();
  try {
    const answer = await call("GET", `jumps/comparison?${query}`, undefined, DEADLINE_MS);
    if (whose === athlete) found = answer;
  } catch (error) {
    if (error instanceof Problem && error.status === 409) tell("error", t("spans.busy"));
    else if (error instanceof Problem && error.status === 422) tell("error", t("spans.refused", { why: say(error.detail).text }));
    else tellProblem(error);
  } finally {
    asking = false;
    drawSpans();
  }
}

/** Draw the answer. */
export function drawSpans() {
  $("spans-compare").disabled = asking;
  $("spans-compare").setAttribute("aria-busy", String(asking));
  $("spans-result").hidden = !found;
  setText($("spans-said"), asking ? t("spans.asking") : found ? inWords(found) : "");
  if (!found) return;
  const rows = Object.keys(QUANTITIES).flatMap((name) => found?.quantities.filter(({ quantity }) => quantity === name) ?? []);
  rows.sort((one, two) => Number(two.different) - Number(one.different));
  $("spans-table").replaceChildren(make("table", { class: "jumps" },
    make("thead", {}, make("tr", {}, ...["spans.quantity", "spans.difference", "spans.needed", "spans.at", "spans.p"].map((key) => make("th", {}, t(key))))),
    make("tbody", {}, ...rows.map((row) => {
      const [unit, digits] = QUANTITIES[row.quantity];
      return make("tr", row.different ? { class: "different" } : {},
        make("td", {}, `${row.different ? "✓ " : ""}${t(`spans.q_${row.quantity}`)}`),
        make("td", {}, `${signed(row.difference, digits)}\u202f±\u202f${number(row.sigma, digits)}\u202f${unit}`),
        make("td", {}, `${number(row.needed, digits)}\u202f${unit}`),
        make("td", {}, `${signed(row.since_takeoff_s, 2)}\u202fs`),
        make("td", {}, row.p < 0.001 ? `<\u202f${number(0.001, 3)}` : number(row.p, row.p < 0.1 ? 3 : 2)));
    }))));
}

/** @param {Comparison} comparison */
function inWords({ first, second, left_out, scatter_jumps, different, one_place }) {
  const names = different.map((name) => t(`spans.q_${name}`)).join(", ");
  return [
    names ? t("spans.different", { names, first, second }) : t("spans.chance", { first, second }),
    t(scatter_jumps ? "spans.scatter" : "spans.single", { count: scatter_jumps }),
    scatter_jumps && scatter_jumps < FEW ? t("spans.few") : "",
    left_out ? t("spans.left_out", { count: left_out }) : "",
    one_place ? "" : t("spans.places"),
  ].filter(Boolean).join(" ");
}

/**
 * @param {number} value
 * @param {number} digits
 */
function signed(value, digits) {
  return `${value > 0 ? "+" : ""}${number(value, digits)}`;
}
