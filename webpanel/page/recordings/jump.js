/** What the analysis has drawn of the jumps of the recording shown: loads it, and gives it to the picture and the curves. */

import { t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { showCurves } from "../viewing/curves.js";
import { showSticks } from "../viewing/stick.js";

/** @typedef {import("./types.js").Measurement} Measurement */

/** The file of the result, as `analysis.report.overlay_file` writes it. */
const FILE = "overlay.json";
const FORMAT = "svev-overlay/1";

/** Of which result something is drawn, or is being loaded. */
let drawn = "";
/** Whether there are figures of a log, but no drawing of them. */
let missing = false;

/**
 * Draw what belongs to a result.
 *
 * @param {Measurement|null} measured null: nothing is known (yet)
 */
export async function showJump(measured) {
  const result = measured && measured.files.includes(FILE) ? `${measured.recording} ${measured.measured}` : "";
  missing = Boolean(measured && measured.figures.length && !measured.live && !result);
  drawJump();
  if (result === drawn) return;
  drawn = result;
  show([]);
  if (!measured || !result) return;
  const content = await call("GET", recordingPath(measured.recording, `/measurement/files/${FILE}`));
  if (drawn === result && content.format === FORMAT) show(content.jumps);
}

/** Say why nothing is drawn, perhaps in another language. */
export function drawJump() {
  $("stick-missing").hidden = !missing;
  setText($("stick-missing"), missing ? t("jump.no_drawing") : "");
}

/** @param {import("../viewing/stick.js").Jump[]} jumps */
function show(jumps) {
  showSticks(jumps);
  showCurves(jumps);
}
