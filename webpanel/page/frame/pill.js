/** The state of the rig in every view: small at the top, and in the title of the page. */

import { t } from "../i18n/i18n.js";
import { $, setIcon, setText } from "../shared/dom.js";
import { clock } from "../shared/format.js";
import { recordedFor, STATE_ICONS } from "../shared/state.js";
import { known, watch } from "../shared/store.js";

export function startPill() {
  watch(draw);
  setInterval(drawTime, 250);
}

function draw() {
  const { status, connected } = known;
  const state = status?.state ?? "unknown";
  document.body.classList.toggle("stale", !connected);
  document.title = `${t(`state.${state}`)} – Svev`;
  $("pill").dataset.state = state;
  $("pill").dataset.level = status?.statement.level ?? "";
  setIcon($("pill").querySelector("svg"), STATE_ICONS[state]);
  drawTime();
}

function drawTime() {
  const { status, connected } = known;
  const seconds = connected && status?.recording ? ` ${clock(recordedFor())}` : "";
  setText($("pill").querySelector("span"), t(`state.${status?.state ?? "unknown"}`) + seconds);
}
