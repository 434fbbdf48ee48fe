/** A table of measured jumps that is sorted by a tap on a heading. */

import { t } from "../i18n/i18n.js";
import { make, makeMark } from "../shared/dom.js";
import { levelOf, MARKS } from "../shared/figures.js";
import { timeInWords, timeOfDay } from "../shared/format.js";
import { FIGURES, figureInWords, figureOf } from "./figures.js";

/** @typedef {import("./types.js").AthleteJump} AthleteJump */
/**
 * @typedef {object} Column
 * @property {string} key of its words
 * @property {(jump: AthleteJump) => string|number} order by which it is sorted; what is empty or not a number stands last
 * @property {(jump: AthleteJump) => Node|string} cell
 */

/** @type {Column} */
const TIME = { key: "athletes.time", order: ({ jump }) => jump.time, cell: ({ jump }) => linkTo(jump, timeOfDay(jump.time)) };
/** @type {Column} */
const WHEN = { key: "athletes.when", order: ({ jump }) => jump.time, cell: ({ jump }) => linkTo(jump, shortTime(jump.time)) };
/** @type {Column} */
const BIB = { key: "field.bib", order: ({ bib }) => (bib && Number.isFinite(Number(bib)) ? Number(bib) : bib), cell: ({ bib }) => bib };
/** @type {Column} */
const ATHLETE = { key: "field.athlete", order: ({ athlete }) => athlete.toLocaleLowerCase(), cell: ({ athlete }) => linkToAthlete(athlete) };
/** @type {Column} */
const GATE = { key: "field.gate", order: ({ gate }) => (gate && Number.isFinite(Number(gate)) ? Number(gate) : gate), cell: ({ gate }) => gate };
/** @type {Column[]} */
const MEASURED = FIGURES.map((figure) => ({
  key: `measured.${figure.name}`, order: (jump) => figureOf(jump, figure.name)?.value ?? NaN, cell: (jump) => figureInWords(jump, figure),
}));
/** @type {Column} */
const LEVEL = { key: "athletes.level", order: (jump) => ["good", "info", "warning"].indexOf(level(jump)), cell: (jump) => makeMark(level(jump), level(jump), t(MARKS[level(jump)])) };

/** So many rows are made before the first pause. */
const AT_ONCE = 60;

/** Columns of the table of a session. */
export const OF_SESSION = [TIME, BIB, ATHLETE, GATE, ...MEASURED, LEVEL];
/** Columns of the table of an athlete. */
export const OF_ATHLETE = [WHEN, GATE, ...MEASURED, LEVEL];

/**
 * Day and time in little room; the year only if it is another one.
 *
 * @param {string} time ISO text
 */
function shortTime(time) {
  const then = new Date(time);
  const year = then.getFullYear() === new Date().getFullYear() ? undefined : "2-digit";
  return timeInWords(then, { day: "numeric", month: "short", year, hour: "2-digit", minute: "2-digit", hourCycle: "h23" });
}

/** @param {AthleteJump} jump */
function level(jump) {
  return levelOf(jump.jump, jump.level === "info");
}

/**
 * Where a recording is shown, and which of its jumps.
 *
 * @param {import("./types.js").LastJump} jump
 * @param {string} words
 */
function linkTo(jump, words) {
  const [several, which] = jump.jump > 1 ? [` (${t("athletes.jump", { jump: jump.jump })})`, `/${jump.jump}`] : ["", ""];
  return make("a", { href: `#/recordings/${encodeURIComponent(jump.recording)}${which}` }, words + several);
}

/** @param {string} name */
function linkToAthlete(name) {
  return name.trim() ? make("a", { href: `#/athlete/${encodeURIComponent(name)}` }, name) : t("recordings.nobody");
}

/**
 * A table in an element; call what is returned whenever jumps or language have changed.
 *
 * @param {HTMLElement} place
 * @param {Column[]} columns
 * @param {boolean} newestFirst
 * @returns {(jumps: AthleteJump[]) => void}
 */
export function makeTable(place, columns, newestFirst) {
  let [by, down] = [columns[0], newestFirst];
  /** @type {AthleteJump[]} */
  let shown = [];
  const draw = () => {
    const focused = document.activeElement?.getAttribute("data-sort");
    place.replaceChildren(make("table", { class: "jumps" },
      make("thead", {}, make("tr", {}, ...columns.map((column) => make("th", { "aria-sort": column === by ? (down ? "descending" : "ascending") : "none" },
        make("button", { type: "button", class: "plain", "data-sort": column.key, onclick: () => sort(column) }, t(column.key), make("span", { "aria-hidden": "true" }, column === by ? (down ? " ▾" : " ▴") : "")))))),
      fillBody(make("tbody"), sorted(shown, by, down), columns)));
    if (focused) /** @type {HTMLElement|null} */ (place.querySelector(`[data-sort="${focused}"]`))?.focus({ preventScroll: true });
  };
  /** @param {Column} column */
  const sort = (column) => {
    down = column === by ? !down : false;
    by = column;
    draw();
  };
  return (jumps) => { shown = jumps; draw(); };
}

/**
 * Add the rows: a screenful at once and the others after it is drawn, each time twice as many, since the table is laid out anew.
 *
 * @param {HTMLElement} body
 * @param {AthleteJump[]} jumps
 * @param {Column[]} columns
 * @param {number} [count]
 */
function fillBody(body, jumps, columns, count = AT_ONCE) {
  body.append(...jumps.slice(0, count).map((jump) => make("tr", {}, ...columns.map((column) => make("td", {}, column.cell(jump))))));
  const rest = jumps.slice(count);
  if (rest.length) requestAnimationFrame(() => setTimeout(() => { if (body.isConnected) fillBody(body, rest, columns, 2 * count); }));
  return body;
}

/**
 * @param {AthleteJump[]} jumps
 * @param {Column} by
 * @param {boolean} down
 */
function sorted(jumps, { order }, down) {
  const lacks = (/** @type {string|number} */ value) => value === "" || Number.isNaN(value);
  return jumps.map((jump) => ({ jump, key: order(jump) })).sort((one, two) => {
    if (lacks(one.key) || lacks(two.key)) return Number(lacks(one.key)) - Number(lacks(two.key));
    const found = typeof one.key === "number" && typeof two.key === "number" ? one.key - two.key : String(one.key).localeCompare(String(two.key));
    return down ? -found : found;
  }).map(({ jump }) => jump);
}
