/** The main figures of a measured jump, each with its standard deviation. */

import { say, t } from "../i18n/i18n.js";
import { fillList } from "./dom.js";
import { number } from "./format.js";

/** @typedef {import("./types.js").MeasuredValue} MeasuredValue */

const KMH = 3.6; // km/h in one m/s
/** Most digits of a value after the decimal point. */
const MOST_DIGITS = { "m/s": 4, m: 4, "°": 1 };

/** What is said of a jump of each level. */
export const MARKS = { good: "measured.ok", warning: "measured.doubtful", info: "measurement.live_jump" };

/**
 * What the figures of a jump are worth: those that were measured live are replaced by what the log tells.
 *
 * @param {import("./types.js").LastJump} jump
 * @param {boolean} [live] they are live ones of before that stood in them
 * @returns {"good"|"warning"|"info"}
 */
export function levelOf(jump, live = false) {
  if (live || jump.live) return "info";
  return jump.ok ? "good" : "warning";
}

/**
 * The verdict on a jump in words; that it was measured well, the mark says.
 *
 * @param {import("./types.js").LastJump} jump
 */
export function verdictOf(jump) {
  return jump.said.length ? jump.said.map((each) => say(each).text).join("; ") : jump.verdict; // of an earlier svev: words only
}

/**
 * Fill a <dl class="figures"> with the figures of a jump.
 *
 * @param {Element} list
 * @param {import("./types.js").LastJump} jump
 */
export function fillFigures(list, jump) {
  const speed = (/** @type {MeasuredValue|null} */ of) => (of ? `${withSigma(of, "m/s")}\n${inKmh(of.value)}` : "–");
  fillList(list, [
    [t("measured.takeoff_speed"), speed(jump.takeoff_speed)],
    [t("measured.perpendicular"), withSigma(jump.perpendicular, "m/s")],
    [t("measured.speed_20_m"), speed(jump.speed_20_m)],
    [t("measured.angle_of_attack"), withSigma(jump.angle_of_attack, "°")],
    [t("measured.ski_to_body"), withSigma(jump.ski_to_body, "°")],
  ]);
}

/** @param {number} speed m/s, as coaches say it */
export function inKmh(speed) {
  return `${number(KMH * speed, 1)}\u202fkm/h`;
}

/**
 * The figures of a jump as one reads them from afar: one number in large, and what stands beside it in small.
 *
 * @param {import("./types.js").LastJump} jump
 * @returns {{ term: string, value: string, unit: string, beside: string }[]}
 */
export function inLarge(jump) {
  /** @type {(key: string, speed: MeasuredValue|null) => [string, string, string, string]} */
  const speed = (key, of) => of ? [key, number(KMH * of.value, 1), "km/h", withSigma(of, "m/s")] : [key, "–", "", ""];
  /** @type {(key: string, of: MeasuredValue|null, unit: "m/s"|"°") => [string, string, string, string]} */
  const other = (key, of, unit) => {
    const parts = inParts(of, unit);
    if (!parts) return [key, "–", "", ""];
    return unit === "°" ? [key, `${parts.value}°`, "", `± ${parts.deviation}°`] : [key, parts.value, unit, `± ${parts.deviation}`];
  };
  return [
    speed("measured.takeoff_speed", jump.takeoff_speed), other("measured.perpendicular", jump.perpendicular, "m/s"),
    speed("measured.speed_20_m", jump.speed_20_m), other("measured.angle_of_attack", jump.angle_of_attack, "°"),
    other("measured.ski_to_body", jump.ski_to_body, "°"),
  ].map(([key, value, unit, beside]) => ({ term: t(key), value, unit, beside }));
}

/**
 * A value with its standard deviation as the report has them.
 *
 * @param {MeasuredValue|null} measured
 * @param {keyof typeof MOST_DIGITS} unit
 */
export function withSigma(measured, unit) {
  const parts = inParts(measured, unit);
  if (!parts) return "–";
  const { value, deviation } = parts;
  return unit === "°" ? `${value}° ± ${deviation}°` : `${value} ± ${deviation}\u202f${unit}`;
}

/**
 * The standard deviation has one digit, two if the first is a one, and the value as many decimals; angles no more than coaches say.
 *
 * @param {MeasuredValue|null} measured
 * @param {keyof typeof MOST_DIGITS} unit
 */
function inParts(measured, unit) {
  if (!measured) return null;
  const { value, sigma } = measured;
  const [leading, power] = sigma.toExponential(1).split("e").map(Number);
  const digits = Math.max(0, Number(leading < 2) - power);
  return { value: number(value, Math.min(MOST_DIGITS[unit], digits)), deviation: number(sigma, digits) };
}
