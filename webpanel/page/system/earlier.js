/** An earlier picture of the camera over the live one, to see whether the camera has been turned since. */

import { t } from "../i18n/i18n.js";
import { call, callForPage, partOf, recordingPath } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { day, timeOfDay, who } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";

/** @typedef {import("../shared/types.js").Recording} Recording */
/** @typedef {import("../shared/types.js").Pulses} Pulses */

/** So many recordings can be chosen among, the newest. */
const CHOICES = 100;

/** Name of the camera that is shown. */
let camera = "";
/** The recording whose picture is shown. @type {Pulses|null} */
let chosen = null;
/** @type {Recording[]} */
let choices = [];

export function startEarlier() {
  $("aim-earlier").addEventListener("change", () => void attempt(() => choose($("aim-earlier").value)));
  $("aim-mix").addEventListener("input", draw);
  $("aim-ghost").addEventListener("load", draw);
}

/** The view is entered: offer the recordings that there are. */
export async function enterEarlier() {
  const page = await attempt(() => callForPage(`recordings?limit=${CHOICES}`));
  choices = (page?.items ?? choices).filter((/** @type {Recording} */ { counts, state }) => counts.pulses && state !== "recording");
  drawEarlier();
}

/** Draw the choice, perhaps in another language. */
export function drawEarlier() {
  $("aim-earlier").replaceChildren(
    make("option", { value: "" }, t("aim.nothing")),
    ...choices.map(({ id, session, started }) => make("option", { value: id }, started ? `${day(started)} ${timeOfDay(started)}, ${who(session, id)}` : who(session, id))),
  );
  $("aim-earlier").value = choices.some(({ id }) => id === chosen?.id) ? chosen?.id : "";
  draw();
}

/**
 * Show another camera.
 *
 * @param {string} name
 */
export function earlierOf(name) {
  if (name === camera) return;
  camera = name;
  show();
}

/** @param {string} id "": none */
async function choose(id) {
  chosen = id ? await call("GET", recordingPath(id, "/pulses")) : null;
  show();
}

/** Show the first frame of the camera in the recording. */
function show() {
  const index = chosen?.cameras.indexOf(camera) ?? -1;
  const first = chosen?.pulses.find(({ statuses }) => statuses[index] === "ok");
  if (chosen && first) $("aim-ghost").src = `${partOf(chosen.id, `pulses/${first.pulse}.jpg`)}?camera=${encodeURIComponent(camera)}`;
  else $("aim-ghost").removeAttribute("src");
  draw();
}

function draw() {
  const ghost = $("aim-ghost");
  const there = ghost.hasAttribute("src");
  const live = $("aim-image").naturalWidth;
  const fits = !live || !ghost.naturalWidth || live === ghost.naturalWidth;
  ghost.hidden = !there || !fits;
  ghost.style.opacity = String($("aim-mix").value / 100);
  $("aim-mixing").hidden = ghost.hidden;
  setText($("aim-earlier-not"), chosen && !there ? t("aim.not_there", { camera }) : there && !fits ? t("aim.other_size") : "");
}
