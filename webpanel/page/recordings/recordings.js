/** The list of recordings, page by page, and the trash. Each keeps its place while something else is looked at. */

import { t } from "../i18n/i18n.js";
import { call, callForPage } from "../shared/api.js";
import { hear } from "../shared/connection.js";
import { $, icon, make, setText } from "../shared/dom.js";
import { day, size, who } from "../shared/format.js";
import { place } from "../shared/router.js";
import { attempt } from "../shared/snacks.js";
import { emptyTrash, removeForGood, restore, watchCatalogue } from "./catalogue.js";
import { drawFilters, filtered, filterQuery, sortedByTime, startFilters } from "./filters.js";
import { makeLink } from "./row.js";
import { drawSelection, endSelection, makeBox, startSelection } from "./selection.js";

/** @typedef {import("../shared/types.js").Recording} Recording */
/** @typedef {{ recordings: Recording[]|null, total: number, scrolled: number }} List `recordings`: null before they came */

const PAGE = 50;
/** The service gives no more at once. */
const MOST = 1000;

/** @type {Record<string, List>} */
const lists = { jumps: { recordings: null, total: 0, scrolled: 0 }, trash: { recordings: null, total: 0, scrolled: 0 } };
/** Counts what was asked for: an answer that was overtaken is dropped. */
let asked = 0;
let loadingMore = false;
/** @type {List|null} The list that is shown, null in other views. */
let entered = null;

export function startRecordings() {
  startFilters(() => { list().scrolled = 0; void load(PAGE); });
  startSelection(() => list().recordings ?? [], draw);
  hear({ recordings: reload });
  watchCatalogue(reload);
  $("recordings-more").addEventListener("click", () => void loadMore());
  $("trash-empty").addEventListener("click", () => void emptyTrash());
  new IntersectionObserver((seen) => { if (seen.some(({ isIntersecting }) => isIntersecting)) void loadMore(); }, { rootMargin: "600px" }).observe($("recordings-more"));
}

/** Load the list anew, if it is shown, as far as it was shown. */
export async function reload() {
  if (place().view !== "recordings") return;
  await load(Math.min(MOST, Math.max(PAGE, list().recordings?.length ?? 0)));
}

/** Enter the view: the list stands where it was left, and is brought up to date. */
export function enterRecordings() {
  entered = list();
  endSelection();
  draw();
  scrollTo(0, entered.scrolled);
  void reload();
}

/** Leave the view, if it is shown: the list remembers where it stands. */
export function leaveRecordings() {
  if (entered) entered.scrolled = scrollY;
  entered = null;
}

/** Draw the list. */
export function draw() {
  const { trash } = place();
  const { recordings, total } = list();
  const found = recordings ?? [];
  drawFilters();
  drawSelection();
  setText($("recordings-title"), t(trash ? "trash.title" : "nav.recordings"));
  setText($("recordings-count"), recordings && filtered() ? t("recordings.found", { total }) : "");
  $("recordings-other").href = trash ? "#/recordings" : "#/trash";
  $("recordings-other").replaceChildren(icon(trash ? "recordings" : "trash"), make("span", {}, t(trash ? "nav.recordings" : "trash.title")));
  $("trash-about").hidden = !trash || !found.length;
  $("recordings-empty").hidden = recordings === null || found.length > 0;
  setText($("recordings-empty"), t(filtered() ? "recordings.none_found" : trash ? "trash.empty" : "recordings.empty"));
  $("recordings-more").hidden = found.length >= total;
  const focused = document.activeElement?.getAttribute("href");
  $("recordings-list").replaceChildren(...byDay(found).flatMap(([date, those], index, days) => [
    date ? make("h2", { class: "day" }, date, make("span", {}, index < days.length - 1 || found.length >= total ? String(those.length) : "")) : "",
    make("ul", { class: "rows" }, ...those.map(makeRow)),
  ]));
  // The link that had the focus was replaced by a new one: who works by keys goes on there.
  if (focused) [...$("recordings-list").querySelectorAll("a")].find((link) => link.getAttribute("href") === focused)?.focus({ preventScroll: true });
}

function list() {
  return lists[place().trash ? "trash" : "jumps"];
}

/** @param {number} limit @param {number} [offset] */
function query(limit, offset = 0) {
  const wanted = filterQuery();
  wanted.set("limit", String(limit));
  if (offset) wanted.set("offset", String(offset));
  if (place().trash) wanted.set("deleted", "true");
  return `recordings?${wanted}`;
}

/** @param {number} limit */
async function load(limit) {
  const shown = list();
  const mine = asked += 1;
  const page = await attempt(() => callForPage(query(limit)));
  if (!page || mine !== asked) return;
  Object.assign(shown, { recordings: page.items, total: page.total });
  if (shown !== list()) return;
  draw();
  if (place().trash) await drawTrash();
}

async function loadMore() {
  const shown = list();
  const there = shown.recordings;
  if (loadingMore || !there || there.length >= shown.total || place().view !== "recordings") return;
  loadingMore = true;
  const mine = asked += 1;
  const page = await attempt(() => callForPage(query(PAGE, there.length)));
  loadingMore = false;
  if (!page || mine !== asked) return;
  const known = new Set(there.map(({ id }) => id)); // one may have been recorded meanwhile, which moves all others
  shown.recordings = [...there, ...page.items.filter(({ id }) => !known.has(id))];
  shown.total = page.items.length ? page.total : shown.recordings.length;
  if (shown === list()) draw();
}

/** Say how much room the trash takes. */
async function drawTrash() {
  /** @type {import("../shared/types.js").Trash|null} */
  const trash = await attempt(() => call("GET", "trash"));
  if (trash) setText($("trash-words"), t("trash.about", { count: trash.recordings, size: size(trash.bytes) }));
}

/**
 * @param {Recording[]} those
 * @returns {[string, Recording[]][]} days, or one part without a heading where the order is another one
 */
function byDay(those) {
  if (!sortedByTime()) return [["", those]];
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
  const row = make("li", { class: "row" }, makeBox(recording, who(recording.session, recording.id)), makeLink(recording));
  const name = recording.session.athlete.trim();
  if (!place().trash) {
    if (name) row.append(make("a", { class: "button square plain", href: `#/athlete/${encodeURIComponent(name)}`, "aria-label": t("athletes.of", { athlete: name }), title: t("athletes.of", { athlete: name }) }, icon("athlete")));
    return row;
  }
  row.classList.add("deleted");
  row.append(
    make("button", { type: "button", "data-needs": "administer", onclick: () => void restore(recording) }, icon("restore"), make("span", {}, t("trash.restore"))),
    make("button", { type: "button", "data-needs": "administer", onclick: () => void removeForGood([recording]) }, icon("close"), make("span", {}, t("trash.remove"))));
  return row;
}
