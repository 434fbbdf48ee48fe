/** The jump that was measured last: five figures with their standard deviations, and whether they can be trusted. */

import { t } from "../i18n/i18n.js";
import { $, fillList, setText } from "../shared/dom.js";
import { number, timeOfDay } from "../shared/format.js";
import { known, watch } from "../shared/store.js";

/** @typedef {import("../shared/types.js").MeasuredValue} MeasuredValue */

export function startMeasured() {
  watch(drawMeasured);
}

function drawMeasured() {
  const jump = known.status?.last_jump ?? null;
  $("measured").hidden = !jump;
  if (!jump) return;
  setText($("measured-time"), timeOfDay(jump.time));
  $("measured-verdict").dataset.level = jump.ok ? "good" : "warning";
  setText($("measured-verdict"), jump.ok ? t("measured.ok") : t("measured.doubtful"));
  $("measured-why").hidden = jump.ok;
  setText($("measured-why"), jump.ok ? "" : jump.verdict);
  fillList($("measured-figures"), [
    [t("measured.takeoff_speed"), withSigma(jump.takeoff_speed, "m/s")],
    [t("measured.perpendicular"), withSigma(jump.perpendicular, "m/s")],
    [t("measured.speed_20_m"), withSigma(jump.speed_20_m, "m/s")],
    [t("measured.angle_of_attack"), withSigma(jump.angle_of_attack, "°")],
    [t("measured.ski_to_body"), withSigma(jump.ski_to_body, "°")],
  ]);
}

/**
 * A value with its standard deviation, both to the same place: the first digit of the standard deviation.
 *
 * @param {MeasuredValue|null} measured
 * @param {string} unit
 */
function withSigma(measured, unit) {
  if (!measured) return "–";
  const digits = Math.min(4, Math.max(0, -Math.floor(Math.log10(measured.sigma))));
  return `${number(measured.value, digits)}\u202f±\u202f${number(measured.sigma, digits)}\u202f${unit}`;
}
