/** The figures that an operator looks at: pulses, seconds kept, room on the disk, warmth. */

import { $, fillList } from "./dom.js";
import { number, quantity } from "./format.js";
import { t } from "./i18n.js";
import { known, watch } from "./store.js";

const FEW_JUMPS = 20;

export function startVitals() {
  watch(draw);
}

function draw() {
  const { status } = known;
  if (!status) return;
  const { pulses, preroll, disk, state } = status;
  const on = state === "armed" || state === "recording";
  const warmest = Math.max(...status.cameras.map((camera) => camera.temperature_c ?? -Infinity));
  fillList($("vitals"), [
    [t("vitals.pulses"), pulses.arriving ? quantity(pulses.rate_hz, 1, "/s") : t(on ? "vitals.none" : "vitals.off"), on && !pulses.arriving ? "warning" : ""],
    [t("vitals.spread"), quantity(pulses.arriving ? pulses.spread_us : null, 1, "µs")],
    [t("vitals.preroll"), quantity(preroll.seconds, 1, "s")],
    [t("vitals.jumps"), number(disk.jumps_left), disk.jumps_left < 1 ? "error" : disk.jumps_left < FEW_JUMPS ? "warning" : ""],
    [t("vitals.free"), quantity(disk.free_gb, 0, "GB")],
    [t("vitals.warmest"), Number.isFinite(warmest) ? quantity(warmest, 0, "°C") : "–"],
  ]);
}
