/** The start list: who has jumped, who is next, who waits. A tap on a name makes him the next one. */

import { say, t } from "../i18n/i18n.js";
import { call, Problem } from "../shared/api.js";
import { $, icon, make, setText } from "../shared/dom.js";
import { attempt } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";
import { startListLoading } from "./listload.js";
import { adopt, flush } from "./session.js";

/** @typedef {import("../shared/types.js").StartLine} StartLine */
/** @typedef {import("../shared/types.js").StartList} StartList */

/** Fields that may be carried over, in the order of the form. */
const CARRIED = ["bib", "athlete", "gate", "wind", "operator", "notes"];

/** @type {StartList|null} */
let list = null;
let fetching = false;
let editing = false;
/** Rows that are shown, by the id of their line, with what they show: those that stay the same stay where they are. */
/** @type {Map<number, { key: string, row: HTMLElement }>} */
let shown = new Map();
/** Version of the list and language of the words that the rows have. */
let drawn = "";

export function startStartList() {
  $("list-undo").addEventListener("click", () => void change("POST", "start-list/undo", { version: list?.version }));
  $("list-edit").addEventListener("click", edit);
  startListLoading(() => list?.lines.length ?? 0, (found) => { take(found); adopt(found.next); });
  $("list-round").addEventListener("click", () => void change("POST", "start-list/round"));
  $("list-add").addEventListener("submit", add);
  $("list-auto").addEventListener("change", () => void change("PATCH", "start-list", { auto_advance: $("list-auto").checked }));
  $("list-carry").append(...CARRIED.map(makeCarried));
  $("list-rows").addEventListener("click", pressed);
  watch(follow);
}

function edit() {
  editing = !editing;
  if (list) drawRows(list); // only then its rows have the buttons to edit it
  draw();
}

/** Fetch the list if the service has a newer one. */
function follow() {
  const version = known.status?.next_jumper.version ?? 0;
  if (known.view === "live" && known.connected && !fetching && (!list || list.version < version)) void fetchList();
  draw();
}

async function fetchList() {
  fetching = true;
  try {
    take(await call("GET", "start-list"));
  } catch (error) {
    if (!(error instanceof Problem)) throw error; // the next status asks again
  } finally {
    fetching = false;
  }
}

/** @param {StartList} found */
function take(found) {
  if (list && found.version < list.version) return;
  list = found;
  drawRows(found);
  draw();
}

/**
 * @param {string} method
 * @param {string} path
 * @param {object} [body]
 */
async function change(method, path, body) {
  await flush();
  const found = await attempt(() => call(method, path, body));
  if (!found) return;
  take(found);
  adopt(found.next);
}

/** @param {SubmitEvent} event */
async function add(event) {
  event.preventDefault();
  const [bib, athlete] = [$("list-bib"), $("list-athlete")];
  if (!bib.value.trim() && !athlete.value.trim()) return;
  await change("POST", "start-list/lines", { bib: bib.value.trim(), athlete: athlete.value.trim() });
  bib.value = athlete.value = "";
  bib.focus();
}

/** @param {MouseEvent} event */
function pressed(event) {
  const button = /** @type {Element} */ (event.target).closest("button");
  const row = button?.closest("li");
  if (!button || !row || !list) return;
  const place = list.lines.findIndex((line) => String(line.id) === row.dataset.line) + 1;
  const path = `start-list/lines/${row.dataset.line}`;
  switch (button.dataset.does) {
    case "choose": return void change("POST", `${path}/choose`);
    case "up": return void change("PATCH", path, { place: Math.max(1, place - 1) });
    case "down": return void change("PATCH", path, { place: Math.min(list.lines.length, place + 1) });
    case "remove": return void change("DELETE", path);
  }
}

function draw() {
  if (!list) return;
  const { lines, undo } = list;
  const jumped = lines.filter((line) => line.mark === "jumped").length;
  setText($("list-title"), lines.length ? t("list.title", { round: list.round, jumped, of: lines.length }) : t("list.none"));
  $("list-undo").disabled = !undo;
  setText($("list-undone"), undo ? say(undo).text : "");
  $("list-edit").setAttribute("aria-expanded", String(editing));
  $("list-tools").hidden = !editing;
  $("startlist").classList.toggle("editing", editing);
  $("list-auto").checked = list.auto_advance;
  for (const box of $("list-carry").querySelectorAll("input")) {
    box.checked = list.carry.includes(box.name);
    setText(box.nextElementSibling, t(`field.${box.name}`));
  }
  const words = `${list.version} ${document.documentElement.lang}`;
  if (words === drawn) return; // a list may have two thousand rows, and a status comes every second
  drawn = words;
  for (const row of $("list-rows").children) drawRow(row);
}

/** @param {StartList} found */
function drawRows(found) {
  const rows = $("list-rows");
  const before = rows.querySelector("[aria-current]");
  const focused = /** @type {HTMLElement|null} */ (document.activeElement)?.closest("#list-rows li")?.getAttribute("data-line");
  const does = document.activeElement?.getAttribute("data-does");
  const made = new Map(found.lines.map((line) => {
    const key = JSON.stringify([line, line.id === found.next.line, editing]);
    const kept = shown.get(line.id);
    return [line.id, kept?.key === key ? kept : { key, row: makeRow(line) }];
  }));
  for (const [id, { row }] of shown) {
    const now = made.get(id);
    if (!now) row.remove();
    else if (now.row !== row) row.replaceWith(now.row);
  }
  let place = rows.firstElementChild;
  for (const { row } of made.values()) {
    if (row === place) place = place.nextElementSibling;
    else rows.insertBefore(row, place);
  }
  shown = made;
  drawn = "";
  if (focused) rows.querySelector(`[data-line="${focused}"] [data-does="${does}"]`)?.focus({ preventScroll: true });
  const next = rows.querySelector("[aria-current]");
  if (next && before?.getAttribute("data-line") !== next.dataset.line) {
    rows.scrollTop = next.offsetTop - rows.offsetTop - rows.clientHeight / 3; // the rest of the page stays where it is
  }
}

/** @param {StartLine} line */
function makeRow(line) {
  const name = make("span", { class: "list-name" }, make("b", {}, line.bib), make("span", {}, line.athlete || "–"),
    make("small", {}, [line.club, ...Object.values(line.more)].filter(Boolean).join("  ·  ")), make("em"));
  const row = make("li", { "data-line": String(line.id), "data-mark": line.mark },
    make("button", { type: "button", class: "list-jumper", "data-does": "choose" }, name),
    ...(editing ? [["up", "frame-back"], ["down", "frame-on"], ["remove", "close"]] : []).map(([does, picture]) =>
      make("button", { type: "button", class: `square list-${does}`, "data-does": does }, icon(picture))));
  if (line.id === list?.next.line) row.setAttribute("aria-current", "true");
  return row;
}

/** @param {HTMLElement} row */
function drawRow(row) {
  const next = row.hasAttribute("aria-current");
  setText(row.querySelector("em") ?? row, t(next ? "list.next" : `list.${row.dataset.mark}`));
  const name = row.querySelector(".list-name > span")?.textContent ?? "";
  for (const does of ["up", "down", "remove"]) {
    row.querySelector(`.list-${does}`)?.setAttribute("aria-label", t(`list.${does}`, { who: name }));
  }
}

/** @param {string} name */
function makeCarried(name) {
  const box = make("input", { type: "checkbox", name, onchange: () => {
    const carry = [...$("list-carry").querySelectorAll("input:checked")].map((/** @type {HTMLInputElement} */ each) => each.name);
    void change("PATCH", "start-list", { carry });
  } });
  return make("label", { class: "check" }, box, make("span"));
}
