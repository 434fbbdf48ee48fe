/** The figures of measured jumps that tables and charts have, and the days on which they were jumped. */

import { withSigma } from "../shared/figures.js";

/** @typedef {import("./types.js").AthleteJump} AthleteJump */
/** @typedef {import("../shared/types.js").MeasuredValue} MeasuredValue */
/** @typedef {"takeoff_speed"|"perpendicular"|"speed_20_m"|"angle_of_attack"|"ski_to_body"} Name */

/** @type {{ name: Name, unit: "m/s"|"°" }[]} */
export const FIGURES = [
  { name: "takeoff_speed", unit: "m/s" }, { name: "perpendicular", unit: "m/s" }, { name: "speed_20_m", unit: "m/s" },
  { name: "angle_of_attack", unit: "°" }, { name: "ski_to_body", unit: "°" },
];

/**
 * @param {AthleteJump} jump
 * @param {Name} name
 * @returns {MeasuredValue|null}
 */
export function figureOf({ jump }, name) {
  return jump[name];
}

/**
 * Value and standard deviation of a figure in words.
 *
 * @param {AthleteJump} jump
 * @param {{ name: Name, unit: "m/s"|"°" }} figure
 */
export function figureInWords(jump, { name, unit }) {
  return withSigma(figureOf(jump, name), unit);
}

/**
 * The day of a time here, e.g. 2026-02-14.
 *
 * @param {string} time ISO text
 */
export function dayOf(time) {
  const then = new Date(time);
  return `${then.getFullYear()}-${String(then.getMonth() + 1).padStart(2, "0")}-${String(then.getDate()).padStart(2, "0")}`;
}

/**
 * Beginning and end of days here, the last one included, as the API wants them.
 *
 * @param {string} first e.g. 2026-02-14
 * @param {string} [last]
 */
export function spanOf(first, last = first) {
  const [since, until] = [new Date(`${first}T00:00`), new Date(`${last}T00:00`)];
  until.setDate(until.getDate() + 1);
  return { since: since.toISOString(), until: until.toISOString() };
}

/**
 * What a name has in common with the same one in other spellings, as the service has it.
 *
 * @param {string} name
 */
export function folded(name) {
  return name.normalize("NFKC").toLowerCase().split(/\s+/).filter(Boolean).join(" ");
}
