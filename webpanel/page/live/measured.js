/** The last jump: whose it is, its take-off again and again, its figures or how far their measuring is; and how many logs wait. */

import { t } from "../i18n/i18n.js";
import { $, setText } from "../shared/dom.js";
import { fillFigures, levelOf, MARKS, verdictOf } from "../shared/figures.js";
import { timeOfDay } from "../shared/format.js";
import { howFar, latest, latestFigures, named } from "../shared/latest.js";
import { makeReplay } from "../shared/replay.js";
import { known, watch } from "../shared/store.js";

/** @type {import("../shared/replay.js").Replay} */
let replay;
/** Whether the card is in sight, so that its pictures are worth fetching. */
let near = false;

export function startMeasured() {
  replay = makeReplay($("measured-replay"), { may: () => near && known.view === "live" && known.connected && !known.status?.recording, button: true });
  new IntersectionObserver((seen) => { near = Boolean(seen.at(-1)?.isIntersecting); draw(); }).observe($("measured"));
  watch(draw);
}

/** Draw the words anew, in another language. */
export function drawMeasured() {
  replay.draw();
}

function draw() {
  const { recording, measured } = latest;
  const figures = latestFigures();
  const queue = queueInWords();
  $("measured").hidden = !recording && !queue;
  setText($("measured-queue"), queue);
  $("measured-queue").hidden = !queue;
  setText($("measured-title"), t(recording ? "measured.title" : "measurement.title"));
  setText($("measured-time"), recording?.started ? timeOfDay(figures?.time ?? recording.started) : "");
  for (const part of ["measured-who", "measured-replay"]) $(part).hidden = !recording;
  for (const part of ["measured-verdict", "measured-figures"]) $(part).hidden = !figures;
  const far = recording ? howFar(measured, Boolean(figures)) : "";
  setText($("measured-far"), far);
  $("measured-far").hidden = !far;
  $("measured-why").hidden = !figures || figures.ok;
  if (!recording) return replay.show("");
  if (near) replay.show(recording.id, measured?.measured ?? "", figures?.jump);
  setText($("measured-who"), named(recording.session));
  $("measured-who").href = `#/recordings/${encodeURIComponent(recording.id)}${figures && figures.jump > 1 ? `/${figures.jump}` : ""}`;
  if (!figures) return;
  const level = levelOf(figures);
  $("measured-verdict").dataset.level = level;
  setText($("measured-verdict"), t(MARKS[level]));
  setText($("measured-why"), figures.ok ? "" : verdictOf(figures));
  fillFigures($("measured-figures"), figures);
}

/** How many logs are being measured or copied, and wait; empty if there are none. */
function queueInWords() {
  const measuring = known.status?.measuring;
  if (!measuring) return "";
  const work = measuring.step === "copying" ? "copying" : "running";
  const running = measuring.recording === null ? "" : t(`measured.queue_${measuring.paused ? `${work}_paused` : work}`);
  const waiting = measuring.waiting > 0 ? t("measured.queue_waiting", { count: measuring.waiting }) : "";
  return [running, waiting].filter(Boolean).join(", ");
}
