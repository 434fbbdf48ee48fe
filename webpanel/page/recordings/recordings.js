/** The list of recordings, newest first by day, and the trash; in the live view, the recording that ended last. */

import { say, t } from "../i18n/i18n.js";
import { call, partOf, recordingPath } from "../shared/api.js";
import { hear } from "../shared/connection.js";
import { $, icon, make, makeMark, setText } from "../shared/dom.js";
import { clock, day, size, timeOfDay, who } from "../shared/format.js";
import { place } from "../shared/router.js";
import { attempt } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";
import { restore, watchCatalogue } from "./catalogue.js";

/** @typedef {import("../shared/types.js").Recording} Recording */

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
  recordings = await attempt(() => call("GET", trash ? "recordings?deleted=true" : "recordings")) ?? recordings;
  draw();
}

/** Enter the view. What it showed before may be the other list, so it is emptied first. */
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
  const focused = document.activeElement?.getAttribute("href");
  $("recordings-list").replaceChildren(...byDay(found).flatMap(([date, those]) => [
    make("h2", { class: "day" }, date, make("span", {}, String(those.length))),
    make("ul", { class: "rows" }, ...those.map(makeRow)),
  ]));
  // The link that had the focus was replaced by a new one: who works by keys goes on there.
  if (focused) [...$("recordings-list").querySelectorAll("a")].find((link) => link.getAttribute("href") === focused)?.focus();
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
 * A summary of a recording that links to its view.
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

function drawLast() {
  void loadLast(false);
}

/**
 * Show the recording that ended last in the live view.
 *
 * @param {boolean} again also if it is shown already: somebody may have changed it
 */
async function loadLast(again) {
  const id = known.status?.last_recording ?? "";
  if (!known.connected || (id === last && !again)) return;
  last = id;
  try {
    const recording = id ? await call("GET", recordingPath(id)) : null;
    $("last").hidden = !recording || recording.deleted;
    if (recording) $("last-recording").replaceChildren(makeLink(recording));
  } catch {
    $("last").hidden = true; // it was deleted for good meanwhile, or the connection is lost, which the banner says
  }
}
