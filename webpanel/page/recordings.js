/** The list of recordings, newest first by day, and the trash. */

import { call, partOf } from "./api.js";
import { restore, watchCatalogue } from "./catalogue.js";
import { $, icon, make, setText } from "./dom.js";
import { hear } from "./events.js";
import { clock, day, size, timeOfDay, who } from "./format.js";
import { say, t } from "./i18n.js";
import { place } from "./router.js";
import { tellProblem } from "./snacks.js";
import { known, watch } from "./store.js";

/** @typedef {import("./types.js").Recording} Recording */

/** @type {Recording[]|null} */
let recordings = null;
let last = "";

export function startRecordings() {
  $("recordings-search").addEventListener("input", draw);
  hear({ recordings: reload });
  watchCatalogue(reload);
  watch(drawLast);
}

/** Load the list anew, if it is shown. */
export async function reload() {
  const { view, trash } = place();
  void loadLast(true);
  if (view !== "recordings") return;
  try {
    recordings = await call("GET", trash ? "recordings?deleted=true" : "recordings");
  } catch (error) {
    tellProblem(error);
  }
  draw();
}

/** The view was entered: what was shown before may be the other list. */
export function enterRecordings() {
  recordings = null;
  draw();
  void reload();
}

/** Draw the list. */
export function draw() {
  const { trash } = place();
  const sought = $("recordings-search").value.trim().toLowerCase();
  const found = (recordings ?? []).filter((recording) => !sought || searchable(recording).includes(sought));
  setText($("recordings-title"), t(trash ? "trash.title" : "nav.recordings"));
  $("recordings-other").href = trash ? "#/recordings" : "#/trash";
  $("recordings-other").replaceChildren(icon(trash ? "recordings" : "trash"), make("span", {}, t(trash ? "nav.recordings" : "trash.title")));
  $("recordings-empty").hidden = recordings === null || found.length > 0;
  setText($("recordings-empty"), t(sought ? "recordings.none_found" : trash ? "trash.empty" : "recordings.empty"));
  $("recordings-list").replaceChildren(...byDay(found).flatMap(([date, those]) => [
    make("h2", { class: "day" }, date, make("span", {}, String(those.length))),
    make("ul", { class: "rows" }, ...those.map(makeRow)),
  ]));
}

/** @param {Recording} recording */
function searchable({ id, session }) {
  return `${id} ${session.bib} ${session.athlete} ${session.notes}`.toLowerCase();
}

/**
 * @param {Recording[]} those
 * @returns {[string, Recording[]][]}
 */
function byDay(those) {
  /** @type {Map<string, Recording[]>} */
  const days = new Map();
  for (const recording of those) {
    const date = recording.started ? day(recording.started) : t("recordings.no_date");
    days.set(date, [...(days.get(date) ?? []), recording]);
  }
  return [...days];
}

/** @param {Recording} recording */
function makeRow(recording) {
  const { trash } = place();
  const row = make("li", { class: "row" }, makeLink(recording));
  if (trash) {
    row.append(make("button", { type: "button", onclick: () => void restore(recording) }, icon("restore"), make("span", {}, t("trash.restore"))));
  }
  return row;
}

/**
 * One recording in short, leading to its view.
 *
 * @param {Recording} recording
 */
function makeLink(recording) {
  const { id, session, started, duration_s, bytes, verdict, state } = recording;
  const thumbnail = make("img", { class: "thumbnail", src: partOf(id, "thumbnail.jpg"), alt: "", loading: "lazy", width: 160, height: 90 });
  thumbnail.addEventListener("error", () => thumbnail.classList.add("none"));
  const facts = [started ? timeOfDay(started) : id, clock(duration_s), size(bytes)].join("  ·  ");
  return make("a", { class: "summary", href: `#/recordings/${encodeURIComponent(id)}` },
    thumbnail,
    make("span", { class: "summary-words" },
      make("strong", {}, who(session, t("recordings.nobody"))), make("span", { class: "summary-facts" }, facts),
      state === "recording" ? makeMark("recording", "error", t("state.recording")) : makeMark(verdict.level, verdict.level, say(verdict).text)));
}

/**
 * A verdict: mark and words.
 *
 * @param {string} picture
 * @param {string} level
 * @param {string} words
 */
export function makeMark(picture, level, words) {
  return make("span", { class: "mark", "data-level": level }, icon(picture), make("span", {}, words));
}

function drawLast() {
  void loadLast(false);
}

/**
 * The recording that ended last, in the live view.
 *
 * @param {boolean} again even if it is shown already: somebody may have changed it
 */
async function loadLast(again) {
  const id = known.status?.last_recording ?? "";
  if (!known.connected || (id === last && !again)) return;
  last = id;
  try {
    const recording = id ? await call("GET", `recordings/${encodeURIComponent(id)}`) : null;
    $("last").hidden = !recording || recording.deleted;
    if (recording) $("last-recording").replaceChildren(makeLink(recording));
  } catch {
    $("last").hidden = true; // it was deleted for good meanwhile, or the connection is lost, which the banner says
  }
}
