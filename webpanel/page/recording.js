/** One recording: its triplets (scrubber.js), its session fields, download, delete. */

import { call, partOf } from "./api.js";
import { remove, restore, watchCatalogue } from "./catalogue.js";
import { $, fillList, icon, make, setText } from "./dom.js";
import { hear } from "./events.js";
import { makeFields, writeFields } from "./fields.js";
import { clock, day, number, size, timeOfDay, who } from "./format.js";
import { say, t } from "./i18n.js";
import { makeMark } from "./recordings.js";
import { go, place } from "./router.js";
import { clearScrubber, scrub } from "./scrubber.js";
import { clearSnacks, tell, tellProblem } from "./snacks.js";

/** @typedef {import("./types.js").Recording} Recording */

/** @type {Recording|null} */
let recording = null;

export function startRecording() {
  makeFields($("recording-session").querySelector(".fields"), "recording", changed);
  $("recording-session").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    /** @type {HTMLElement} */ (document.activeElement).blur();
  });
  hear({ recordings: reload });
  watchCatalogue(reload);
}

/**
 * Show a recording.
 *
 * @param {string} id
 */
export async function enterRecording(id) {
  recording = null;
  clearScrubber();
  clearSnacks();
  setText($("recording-title"), id);
  $("recording-verdict").replaceChildren();
  $("recording-buttons").replaceChildren();
  try {
    recording = await call("GET", `recordings/${encodeURIComponent(id)}`);
    draw();
    if (!isRunning()) scrub(await call("GET", `recordings/${encodeURIComponent(id)}/pulses`));
  } catch (error) {
    tellProblem(error);
  }
}

/** Put the recording shown into the trash. */
export async function deleteShown() {
  if (recording && !recording.deleted && !isRunning() && await remove(recording)) go("recordings");
}

/** Somebody may have changed it. */
async function reload() {
  const { view, id } = place();
  if (view !== "recording") return;
  if (isRunning()) return void enterRecording(id); // it may have ended: then there is something to look at
  try {
    recording = await call("GET", `recordings/${encodeURIComponent(id)}`);
    draw();
  } catch (error) {
    tellProblem(error);
  }
}

/** While it is being written, a recording has nothing to look at yet. */
function isRunning() {
  return recording?.state === "recording";
}

/** Draw what is not an image. */
export function draw() {
  if (!recording) return;
  const { id, session, verdict } = recording;
  setText($("recording-title"), who(session, t("recordings.nobody")));
  const { text, advice } = isRunning() ? { text: t("recording.running"), advice: "" } : say(verdict);
  $("player").hidden = isRunning();
  $("recording-verdict").replaceChildren(makeMark(verdict.level, verdict.level, [text, advice].filter(Boolean).join(" – ")));
  writeFields($("recording-session"), session);
  drawFacts(recording);
  $("recording-buttons").replaceChildren(...isRunning() ? [] : [
    make("a", { class: "button primary", href: partOf(id, "file"), download: `${id}.mcap` }, icon("download"), make("span", {}, t("recording.download"))),
    recording.deleted ? makeButton("restore", t("trash.restore"), restoreShown) : makeButton("trash", t("recording.delete"), deleteShown),
  ]);
}

/** @param {Recording} shown */
function drawFacts({ id, started, duration_s, bytes, counts }) {
  const causes = Object.entries(counts.causes).filter(([, count]) => count > 0).map(([cause, count]) => `${count} ${t(`status.${cause}`)}`);
  fillList($("recording-facts"), [
    [t("recording.started"), started ? `${day(started)}, ${timeOfDay(started)}` : "–"],
    [t("recording.duration"), clock(duration_s)],
    [t("recording.pulses"), t("recording.complete_of", { complete: number(counts.complete), pulses: number(counts.pulses) })],
    [t("recording.causes"), causes.join(", ") || t("recording.no_causes")],
    [t("recording.size"), size(bytes)],
    [t("recording.id"), id],
  ]);
}

/**
 * @param {string} picture
 * @param {string} words
 * @param {() => Promise<void>} action
 */
function makeButton(picture, words, action) {
  return make("button", { type: "button", onclick: () => void action() }, icon(picture), make("span", {}, words));
}

async function restoreShown() {
  if (recording) await restore(recording);
}

/**
 * @param {string} name
 * @param {string} value
 */
async function changed(name, value) {
  if (!recording) return;
  try {
    recording = await call("PATCH", `recordings/${encodeURIComponent(recording.id)}`, { [name]: value });
    draw();
    tell("good", t("recording.changed"));
  } catch (error) {
    tellProblem(error);
  }
}
