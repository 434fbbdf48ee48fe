/** Loading a start list from a file: it is looked at first, and replaces the present one when somebody says so. */

import { say, t } from "../i18n/i18n.js";
import { call, Problem } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { tell, tellProblem } from "../shared/snacks.js";

/** @typedef {import("../shared/types.js").StartList} StartList */
/** @typedef {{ bib: string, athlete: string, gate: string, club: string, more: Record<string, string> }} Line */
/**
 * What a file would make of the list: how many jumpers, the first ones, columns that come and go, what is to be chosen.
 *
 * @typedef {{ jumpers: number, lines: Line[], added: string[], removed: string[], sheets: string[],
 *   readings: { encoding: string, words: string[] }[] }} Preview
 */

const TYPES = { table: "text/csv", workbook: "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet" };
/** @type {("bib"|"athlete"|"club"|"gate")[]} known columns in the order in which they are shown */
const COLUMNS = ["bib", "athlete", "club", "gate"];
/** Columns that have a word of their own on the page; others go by their names. */
const KNOWN = new Set(["bib", "athlete", "gate", "club", "notes", "first", "last"]);

/** @type {Blob} */
let file = new Blob();
/** @type {{ encoding?: string, sheet?: string }} what somebody has chosen */
let chosen = {};
/** @type {() => number} */
let present = () => 0;
/** @type {(list: StartList) => void} */
let whenLoaded = () => {};
/** Removes the message that the last file was refused. */
let forget = () => {};

/**
 * @param {() => number} jumpers how many the present list has
 * @param {(list: StartList) => void} loaded takes the new list
 */
export function startListLoading(jumpers, loaded) {
  present = jumpers;
  whenLoaded = loaded;
  $("list-load").addEventListener("click", () => $("list-file").click());
  $("list-file").addEventListener("change", pick);
  $("list-replace").addEventListener("click", replace);
  $("list-cancel").addEventListener("click", () => $("list-preview").close());
}

async function pick() {
  const [picked] = $("list-file").files;
  if (!picked) return;
  const content = await picked.arrayBuffer();
  $("list-file").value = "";
  const [first, second] = new Uint8Array(content);
  file = new Blob([content], { type: first === 0x50 && second === 0x4b ? TYPES.workbook : TYPES.table }); // "PK"
  chosen = {};
  forget();
  setText($("list-choose"), "");
  $("list-choices").replaceChildren();
  if (await look()) $("list-preview").showModal();
}

/** Ask the service what the file would make of the list, and show it; whether it can be read. */
async function look() {
  try {
    draw(await call("POST", `start-list/preview${query()}`, file));
    return true;
  } catch (error) {
    refuse(error);
    return false;
  }
}

async function replace() {
  const empties = $("list-replace").dataset.empties === "yes";
  try {
    const list = await call("PUT", empties ? "start-list" : `start-list${query()}`, empties ? undefined : file);
    $("list-preview").close();
    whenLoaded(list);
    tell("good", t("list.loaded", { jumpers: list.lines.length }));
  } catch (error) {
    refuse(error);
  }
}

function query() {
  const words = new URLSearchParams(chosen).toString();
  return words && `?${words}`;
}

/** @param {unknown} error */
function refuse(error) {
  $("list-preview").close();
  // Which column or line is wrong stands in the service's words only.
  if (error instanceof Problem && error.code === "bad_input") forget = tell("error", t("list.refused", { why: say(error.detail).text }));
  else tellProblem(error);
}

/** @param {Preview} seen */
function draw(seen) {
  const open = seen.sheets.length > 0 || seen.readings.length > 0; // somebody has to choose first
  setText($("list-found"), open ? "" : seen.jumpers
    ? t("list.found", { jumpers: seen.jumpers, present: present() })
    : t("list.heading_alone", { present: present() }));
  drawChoices(seen);
  const [added, removed] = [seen.added, seen.removed].map((names) => names.map(nameOf).join(", "));
  setText($("list-added"), added && !open ? t("list.columns_added", { columns: added }) : "");
  setText($("list-removed"), removed && !open ? t("list.columns_removed", { columns: removed }) : "");
  const shown = COLUMNS.filter((name) => seen.lines.some((line) => line[name]));
  const own = [...new Set(seen.lines.flatMap((line) => Object.keys(line.more)))];
  $("list-first").replaceChildren(...(seen.lines.length && !open ? [
    make("thead", {}, make("tr", {}, ...[...shown, ...own].map((name) => make("th", { scope: "col" }, nameOf(name))))),
    make("tbody", {}, ...seen.lines.map((line) => make("tr", {}, ...[
      ...shown.map((name) => line[name]), ...own.map((name) => line.more[name] ?? ""),
    ].map((text) => make("td", {}, text))))),
  ] : []));
  const more = seen.jumpers - seen.lines.length;
  setText($("list-rest"), more > 0 && !open ? t("list.and_more", { more }) : "");
  const button = $("list-replace");
  button.disabled = open;
  button.dataset.empties = seen.jumpers || open ? "no" : "yes";
  setText(button, t(seen.jumpers || open ? "list.replace" : "list.empty"));
}

/** @param {Preview} seen */
function drawChoices(seen) {
  const sheets = seen.sheets.map((sheet) => choice({ sheet }, sheet));
  const readings = seen.readings.map(({ encoding, words }) => choice({ encoding }, words.join(", ") || encoding));
  if (!sheets.length && !readings.length) return; // what was chosen stays in sight
  setText($("list-choose"), t(sheets.length ? "list.which_sheet" : "list.which_letters"));
  $("list-choices").replaceChildren(...sheets, ...readings);
}

/**
 * @param {{ encoding?: string, sheet?: string }} what
 * @param {string} label
 */
function choice(what, label) {
  const button = make("button", { type: "button", "aria-pressed": "false", onclick: () => {
    chosen = { ...chosen, ...what };
    for (const each of $("list-choices").children) each.setAttribute("aria-pressed", String(each === button));
    void look();
  } }, label);
  return button;
}

/** @param {string} name of a column */
export function nameOf(name) {
  return KNOWN.has(name) ? t(`field.${name}`) : name;
}
