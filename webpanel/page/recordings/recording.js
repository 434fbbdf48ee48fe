/** The view of one recording: its triplets (scrubber.js), session fields, facts, download, delete. */

import { say, t } from "../i18n/i18n.js";
import { archiveOf, call, partOf, Problem, recordingPath } from "../shared/api.js";
import { hear } from "../shared/connection.js";
import { $, fillList, icon, make, makeMark, setText } from "../shared/dom.js";
import { makeFields, writeFields } from "../shared/fields.js";
import { day, length, number, size, timeOfDay, who } from "../shared/format.js";
import { go, place } from "../shared/router.js";
import { attempt, clearSnacks, tell } from "../shared/snacks.js";
import { offer } from "../viewing/comparing.js";
import { enterJumps, jumpShown, onJump } from "../viewing/jumps.js";
import { loadNotes } from "../viewing/notes.js";
import { clearScrubber, scrub, setMoment, toMoment } from "../viewing/scrubber.js";
import { loadVoices } from "../viewing/voice.js";
import { remove, restore, watchCatalogue } from "./catalogue.js";
import { loadExports } from "./exports.js";
import { loadMeasurement } from "./measurement.js";

/** @typedef {import("../shared/types.js").Recording} Recording */

/** What the start list says of a jumper beside own columns, whose names are not ours to translate. @type {Record<string, string>} */
const OF_THE_LIST = { round: "recording.round", club: "recording.club" };

/** @type {Recording|null} */
let recording = null;
/** Whether the triplets of the recording are shown, or are being loaded. */
let scrubbing = false;

export function startRecording() {
  makeFields($("recording-session"), "recording", (name, value) => void change({ [name]: value }));
  $("recording-tags").addEventListener("change", () => void change({ tags: $("recording-tags").value.split(",").map((/** @type {string} */ tag) => tag.trim()).filter(Boolean) }));
  $("recording-favourite").addEventListener("click", () => { if (recording) void change({ favourite: !recording.favourite }); });
  onJump(() => void attempt(toJump));
  hear({ recordings: reload });
  watchCatalogue(reload);
}

/**
 * Show a recording. Until it is there, nothing is shown: least of all the one before.
 *
 * @param {string} id
 */
export async function enterRecording(id) {
  clearSnacks();
  clear(id, "");
  enterJumps(place().jump);
  await attempt(() => load(id));
}

/**
 * @param {string} id
 * @param {string} why nothing is shown
 */
function clear(id, why) {
  recording = null;
  scrubbing = false;
  clearScrubber();
  void loadMeasurement(null);
  setText($("recording-title"), id);
  for (const part of ["recording-verdict", "recording-buttons"]) $(part).replaceChildren();
  for (const part of ["player", "recording-columns", "recording-favourite", "recording-recover"]) $(part).hidden = true;
  setText($("recording-empty"), why);
  $("recording-empty").hidden = !why;
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
  /** @type {Recording} */
  let loaded;
  try {
    loaded = await call("GET", recordingPath(id));
  } catch (error) {
    if (place().id === id && error instanceof Problem && [404, 422].includes(error.status)) return clear(id, t("recording.unknown"));
    throw error;
  }
  if (place().id !== id) return; // another view is shown by now
  if (loaded.state === "recording" && recording && !isRunning()) return; // an answer that was overtaken
  recording = loaded;
  draw();
  void attempt(() => loadMeasurement(loaded));
  if (!isRunning()) {
    void attempt(() => loadNotes(id));
    void attempt(() => loadVoices(id));
  }
  if (isRunning() || scrubbing || !recording.counts.pulses) return;
  scrubbing = true;
  try {
    const pulses = await call("GET", recordingPath(id, "/pulses"));
    if (recording?.id !== id || place().id !== id) return;
    scrub(pulses);
    void loadExports(id, pulses);
    void attempt(() => offer(loaded));
    await loadMoment(id);
  } catch (error) {
    scrubbing = false;
    throw error;
  }
}

/**
 * Find the moment of the jump that is looked at.
 *
 * @param {string} id of the recording
 */
async function loadMoment(id) {
  const jump = jumpShown();
  const { pulse, kind } = await call("GET", recordingPath(id, `/moment?jump=${jump}`));
  if (recording?.id === id && place().id === id && jump === jumpShown()) setMoment(pulse, kind);
}

/** Another jump of the recording is looked at: go to its take-off. */
async function toJump() {
  if (!recording || !scrubbing) return;
  await loadMoment(recording.id);
  toMoment();
}

/** Whether the recording is still being written: then there are no triplets to show yet. */
function isRunning() {
  return recording?.state === "recording";
}

/** Draw everything but the images. */
export function draw() {
  if (!recording) return;
  const { id, session, verdict } = recording;
  drawTitle(session);
  const { text, advice } = isRunning() ? { text: t("recording.running"), advice: "" } : say(verdict);
  const empty = !isRunning() && !recording.counts.pulses;
  $("player").hidden = isRunning() || empty;
  $("recording-columns").hidden = false;
  $("export-form").hidden = $("player").hidden;
  $("recording-empty").hidden = !empty;
  setText($("recording-empty"), empty ? t("recording.no_pulses") : "");
  const toRecover = ["verdict_unfinished", "verdict_damaged", "verdict_headless"].includes(verdict.code);
  $("recording-recover").hidden = !toRecover;
  setText($("recording-recover"), toRecover ? t("recording.recover", { command: `svev recover ${id}.mcap -o ${id}-whole.mcap` }) : "");
  $("recording-favourite").hidden = false;
  $("recording-favourite").setAttribute("aria-pressed", String(recording.favourite));
  if ($("recording-tags") !== document.activeElement) $("recording-tags").value = recording.tags.join(", ");
  $("recording-verdict").replaceChildren(makeMark(verdict.level, verdict.level, [text, advice].filter(Boolean).join(" – ")));
  writeFields($("recording-session"), session);
  drawFacts(recording);
  const buttons = isRunning() ? [] : [
    ...makeDownloads(recording),
    recording.deleted || empty ? null : make("a", { class: "button", id: "recording-digitize", href: `./digitize.html?recording=${encodeURIComponent(id)}`, "data-needs": "operate" }, icon("zoom-in"), make("span", {}, t("digitize.link"))),
    recording.deleted ? makeButton("restore", t("trash.restore"), restoreShown) : makeButton("trash", t("recording.delete"), deleteShown),
  ];
  $("recording-buttons").replaceChildren(...buttons.filter((button) => button !== null));
}

/**
 * Links to the log; of a split recording to all of its logs together, and to each.
 *
 * @param {Recording} shown
 */
function makeDownloads({ id, parts }) {
  if (parts.length < 2) return [make("a", { class: "button primary", href: partOf(id, "file"), download: "" }, icon("download"), make("span", {}, t("recording.download")))];
  const each = parts.map((part, place) => make("a", { class: "button", href: partOf(part, "file"), download: "" }, icon("download"), make("span", {}, t("recording.part", { part: place + 1 }))));
  return [
    make("a", { class: "button primary", id: "recording-parts-all", href: archiveOf([id]), download: "" }, icon("download"), make("span", {}, t("recording.all_parts", { count: parts.length }))),
    make("details", { class: "parts", id: "recording-parts" }, make("summary", {}, t("recording.single_parts")), make("p", { class: "hint" }, t("recording.parts_hint")), make("div", { class: "buttons" }, ...each)),
  ];
}

/**
 * Bib and name; the name leads to all jumps of its owner.
 *
 * @param {import("../shared/types.js").SessionFields} session
 */
function drawTitle(session) {
  const name = session.athlete.trim();
  if (!name) return setText($("recording-title"), who(session, t("recordings.nobody")));
  const link = make("a", { class: "name-link", href: `#/athlete/${encodeURIComponent(name)}`, title: t("athletes.of", { athlete: name }) }, session.athlete);
  $("recording-title").replaceChildren(...session.bib ? [`${session.bib} · `] : [], link);
}

/** @param {Recording} shown */
function drawFacts({ id, started, duration_s, bytes, counts, more, continues, continued_by, parts: files }) {
  const causes = Object.entries(counts.causes).filter(([, count]) => count > 0).map(([cause, count]) => `${count} ${t(`status.${cause}`)}`);
  /** @type {[string, string][]} */
  const listed = Object.entries(more).map(([column, text]) => [column in OF_THE_LIST ? t(OF_THE_LIST[column]) : column, text]);
  /** @type {[string, string][]} */
  const parts = [[t("recording.continues"), continues], [t("recording.continued_by"), continued_by], [t("recording.parts"), files.length > 1 ? files.join(", ") : ""]];
  fillList($("recording-facts"), [
    ...listed,
    [t("recording.started"), started ? `${day(started)}, ${timeOfDay(started)}` : "–"],
    [t("recording.duration"), length(duration_s)],
    [t("recording.pulses"), t("recording.complete_of", { complete: number(counts.complete), pulses: number(counts.pulses) })],
    [t("recording.causes"), causes.join(", ") || t("recording.no_causes")],
    [t("recording.size"), size(bytes)],
    [t("recording.id"), id],
    ...parts.filter(([, part]) => part),
  ]);
}

/**
 * @param {string} picture
 * @param {string} words
 * @param {() => Promise<void>} action
 */
function makeButton(picture, words, action) {
  return make("button", { type: "button", "data-needs": "administer", onclick: () => void action() }, icon(picture), make("span", {}, words));
}

async function restoreShown() {
  if (recording) await restore(recording);
}

/** @param {object} what session fields, tags, or whether it is a favourite */
async function change(what) {
  if (!recording) return;
  const { id } = recording;
  await attempt(async () => {
    const changed = await call("PATCH", recordingPath(id), what);
    if (recording?.id !== id) return;
    recording = changed;
    draw();
    void attempt(() => loadMeasurement(changed)); // what says the old name is gone from its files
    tell("good", t("recording.changed"));
  });
}
