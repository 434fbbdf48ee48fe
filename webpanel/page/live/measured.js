/** The jump that was measured last: whose it is, its figures, whether they can be trusted; and how many logs are measured and wait. */

import { t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { hear } from "../shared/connection.js";
import { $, setText } from "../shared/dom.js";
import { fillFigures, levelOf, MARKS, verdictOf } from "../shared/figures.js";
import { timeOfDay, who } from "../shared/format.js";
import { known, watch } from "../shared/store.js";

/** Id of the recording that was asked for last. */
let asked = "";
/** The recording of the jump; null: not known (yet), or deleted for good. @type {import("../shared/types.js").Recording|null} */
let recording = null;

export function startMeasured() {
  hear({ recordings: () => void load(true) });
  watch(() => {
    void load(false);
    draw();
  });
}

/** @param {boolean} again also if it is known already: somebody may have changed it */
async function load(again) {
  const id = known.status?.last_jump?.recording ?? "";
  if (!known.connected || (id === asked && !again)) return;
  asked = id;
  try {
    const found = id ? await call("GET", recordingPath(id)) : null;
    if (asked === id) recording = found;
  } catch {
    if (asked === id) recording = null; // it was deleted for good meanwhile, or the connection is lost, which the banner says
  }
  draw();
}

function draw() {
  const jump = known.status?.last_jump ?? null;
  const shown = jump && recording?.id === jump.recording && !recording.deleted ? jump : null; // no figures without a name
  const queue = queueInWords();
  $("measured").hidden = !shown && !queue;
  setText($("measured-queue"), queue);
  $("measured-queue").hidden = !queue;
  setText($("measured-title"), t(shown ? "measured.title" : "measurement.title"));
  setText($("measured-time"), shown ? timeOfDay(shown.time) : "");
  for (const part of ["measured-who", "measured-verdict", "measured-figures"]) $(part).hidden = !shown;
  $("measured-why").hidden = !shown || shown.ok;
  if (!shown || !recording) return;
  setText($("measured-who"), who(recording.session, t("recordings.nobody")));
  $("measured-who").href = `#/recordings/${encodeURIComponent(recording.id)}`;
  const level = levelOf(shown);
  $("measured-verdict").dataset.level = level;
  setText($("measured-verdict"), t(MARKS[level]));
  setText($("measured-why"), shown.ok ? "" : verdictOf(shown));
  fillFigures($("measured-figures"), shown);
}

/** How many logs are being measured, and wait; empty if there are none. */
function queueInWords() {
  const measuring = known.status?.measuring;
  if (!measuring) return "";
  const running = measuring.recording === null ? "" : t(measuring.paused ? "measured.queue_paused" : "measured.queue_running");
  const waiting = measuring.waiting > 0 ? t("measured.queue_waiting", { count: measuring.waiting }) : "";
  return [running, waiting].filter(Boolean).join(", ");
}
