/** The view of one recording: its triplets (scrubber.js), session fields, facts, download, delete. */

import { say, t } from "../i18n/i18n.js";
import { call, partOf, recordingPath } from "../shared/api.js";
import { hear } from "../shared/connection.js";
import { $, fillList, icon, make, makeMark, setText } from "../shared/dom.js";
import { makeFields, writeFields } from "../shared/fields.js";
import { clock, day, number, size, timeOfDay, who } from "../shared/format.js";
import { go, place } from "../shared/router.js";
import { attempt, clearSnacks, tell } from "../shared/snacks.js";
import { remove, restore, watchCatalogue } from "./catalogue.js";
import { clearScrubber, scrub } from "./scrubber.js";

/** @typedef {import("../shared/types.js").Recording} Recording */

/** @type {Recording|null} */
let recording = null;
/** Whether the triplets of the recording are shown, or are being loaded. */
let scrubbing = false;

export function startRecording() {
  makeFields($("recording-session"), "recording", changed);
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
  scrubbing = false;
  clearScrubber();
  clearSnacks();
  setText($("recording-title"), id);
  $("recording-verdict").replaceChildren();
  $("recording-buttons").replaceChildren();
  await attempt(() => load(id));
}

/** Put the recording shown into the trash. */
export async function deleteShown() {
  if (recording && !recording.deleted && !isRunning() && await remove(recording)) go("recordings");
}

/** Load the recording anew: somebody may have changed it. */
async function reload() {
  const { view, id } = place();
  if (view !== "recording") return;
  await attempt(() => load(id));
}

/**
 * Load and show a recording; its triplets too as soon as it has ended. Several calls may be on their way at once.
 *
 * @param {string} id
 */
async function load(id) {
  const loaded = await call("GET", recordingPath(id));
  if (place().id !== id) return; // another view is shown by now
  if (loaded.state === "recording" && recording && !isRunning()) return; // an answer that was overtaken
  recording = loaded;
  draw();
  if (isRunning() || scrubbing) return;
  scrubbing = true;
  try {
    scrub(await call("GET", recordingPath(id, "/pulses")));
  } catch (error) {
    scrubbing = false;
    throw error;
  }
}

/** Whether the recording is still being written: then there are no triplets to show yet. */
function isRunning() {
  return recording?.state === "recording";
}

/** Draw everything but the images. */
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
  const { id } = recording;
  await attempt(async () => {
    recording = await call("PATCH", recordingPath(id), { [name]: value });
    draw();
    tell("good", t("recording.changed"));
  });
}
