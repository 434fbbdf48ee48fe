/** The main figures of a measured jump, each with its standard deviation. */

import { say, t } from "../i18n/i18n.js";
import { fillList } from "./dom.js";
import { number } from "./format.js";

/** @typedef {import("./types.js").MeasuredValue} MeasuredValue */

const KMH = 3.6; // km/h in one m/s
/** Digits after the decimal point: of a speed what its standard deviation allows, of an angle no more than coaches say. */
const MOST_DIGITS = { "m/s": 4, "km/h": 4, "°": 1 };

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
  const speed = jump.takeoff_speed;
  fillList(list, [
    [t("measured.takeoff_speed"), speed ? `${withSigma(speed, "m/s")}\n${withSigma({ value: KMH * speed.value, sigma: KMH * speed.sigma }, "km/h")}` : "–"],
    [t("measured.perpendicular"), withSigma(jump.perpendicular, "m/s")],
    [t("measured.speed_20_m"), withSigma(jump.speed_20_m, "m/s")],
    [t("measured.angle_of_attack"), withSigma(jump.angle_of_attack, "°")],
    [t("measured.ski_to_body"), withSigma(jump.ski_to_body, "°")],
  ]);
}

/**
 * The figures of a jump as one reads them from afar: speeds in km/h, value and standard deviation apart.
 *
 * @param {import("./types.js").LastJump} jump
 * @returns {{ term: string, value: string, deviation: string, unit: string }[]}
 */
export function inLarge(jump) {
  /** @type {(speed: MeasuredValue|null) => MeasuredValue|null} */
  const inKmh = (speed) => speed && { value: KMH * speed.value, sigma: KMH * speed.sigma };
  /** @type {[string, MeasuredValue|null, keyof typeof MOST_DIGITS][]} */
  const rows = [
    ["measured.takeoff_speed", inKmh(jump.takeoff_speed), "km/h"], ["measured.perpendicular", jump.perpendicular, "m/s"],
    ["measured.speed_20_m", inKmh(jump.speed_20_m), "km/h"], ["measured.angle_of_attack", jump.angle_of_attack, "°"],
    ["measured.ski_to_body", jump.ski_to_body, "°"],
  ];
  return rows.map(([key, measured, unit]) => ({ term: t(key), unit, ...inParts(measured, unit) ?? { value: "–", deviation: "" } }));
}

/**
 * A value with its standard deviation, both to the same place: the first digit of the standard deviation, if that is shown.
 *
 * @param {MeasuredValue|null} measured
 * @param {keyof typeof MOST_DIGITS} unit
 */
function withSigma(measured, unit) {
  const parts = inParts(measured, unit);
  return parts ? `${parts.value}\u202f±\u202f${parts.deviation}\u202f${unit}` : "–";
}

/**
 * @param {MeasuredValue|null} measured
 * @param {keyof typeof MOST_DIGITS} unit
 */
function inParts(measured, unit) {
  if (!measured) return null;
  const { value, sigma } = measured;
  const digits = Math.min(MOST_DIGITS[unit], Math.max(0, -Math.floor(Math.log10(sigma))));
  const least = 10 ** -digits;
  const deviation = sigma < least / 2 ? `<\u202f${number(least, digits)}` : number(sigma, digits);
  return { value: number(value, digits), deviation };
}
