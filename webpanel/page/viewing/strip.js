/** The strip below the slider: a line for each camera from first pulse to last, with gaps in the colour of their cause. */

import { t } from "../i18n/i18n.js";
import { make } from "../shared/dom.js";

/** @typedef {import("../shared/types.js").Pulses} Pulses */
/** @typedef {{ status: string, first: number, end: number }} Run consecutive pulses with one status */

const SVG = "http://www.w3.org/2000/svg";
const LINE_PX = 18;
/** Least width of a gap as a fraction of the strip: one gap among thousands of pulses must be visible. */
const LEAST = 0.004;
const STATUSES = ["ok", "missed", "lost", "damaged", "absent"];

/**
 * @param {HTMLElement} strip
 * @param {(index: number) => void} sought called with the index of the pulse that is pointed at
 */
export function makeStrip(strip, sought) {
  const lines = make("div", { class: "strip-lines" }, document.createElementNS(SVG, "svg"), make("em", { hidden: true }), make("i"));
  strip.append(make("div", { class: "strip-names" }), lines, make("ul", { class: "strip-key" }));
  /** @param {PointerEvent} event */
  const seek = (event) => {
    const box = lines.getBoundingClientRect();
    sought(Math.floor(((event.clientX - box.left) / box.width) * Number(strip.dataset.pulses)));
  };
  lines.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => { lines.setPointerCapture(event.pointerId); seek(event); });
  lines.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => { if (lines.hasPointerCapture(event.pointerId)) seek(event); });
}

/**
 * @param {HTMLElement} strip
 * @param {Pulses} recording
 */
export function drawStrip(strip, { cameras, pulses }) {
  strip.dataset.pulses = String(pulses.length);
  const [names, lines, key] = [...strip.children].slice(-3);
  names.replaceChildren(...cameras.map((name) => make("span", {}, name)));
  const found = STATUSES.filter((status) => pulses.some(({ statuses }) => statuses.includes(status)));
  key.replaceChildren(...found.map((status) => make("li", { "data-status": status }, t(`status.${status}`))));
  const drawing = /** @type {SVGSVGElement} */ (lines.querySelector("svg"));
  const gaps = pulses.filter(({ statuses }) => statuses.some((status) => status !== "ok")).length;
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", t("scrub.strip", { gaps, pulses: pulses.length }));
  drawing.setAttribute("viewBox", `0 0 ${pulses.length || 1} ${cameras.length * LINE_PX}`);
  drawing.setAttribute("preserveAspectRatio", "none");
  drawing.replaceChildren(...cameras.flatMap((_, camera) => drawLine(pulses.map(({ statuses }) => statuses[camera]), (camera + 0.5) * LINE_PX)));
}

/**
 * Show a stretch of pulses as marked, both ends included; null: there is none.
 *
 * @param {HTMLElement} strip
 * @param {{ first: number, last: number }|null} stretch indices of pulses
 */
export function markStretch(strip, stretch) {
  const mark = /** @type {HTMLElement} */ (strip.querySelector("em"));
  mark.hidden = stretch === null;
  if (!stretch) return;
  const share = 100 / Number(strip.dataset.pulses);
  mark.style.left = `${stretch.first * share}%`;
  mark.style.width = `${(stretch.last - stretch.first + 1) * share}%`;
}

/**
 * Draw one path for each status of a camera.
 *
 * @param {string[]} fates status by pulse
 * @param {number} y
 */
function drawLine(fates, y) {
  const least = fates.length * LEAST;
  const runs = runsOf(fates);
  return STATUSES.map((status) => {
    const path = document.createElementNS(SVG, "path");
    const own = runs.filter((run) => run.status === status);
    path.setAttribute("d", own.map(({ first, end }) => `M${first} ${y}H${Math.max(end, first + least)}`).join(""));
    path.setAttribute("data-status", status);
    return path;
  });
}

/**
 * @param {string[]} fates
 * @returns {Run[]}
 */
function runsOf(fates) {
  /** @type {Run[]} */
  const runs = [];
  fates.forEach((status, index) => {
    const last = runs.at(-1);
    if (last?.status === status) last.end = index + 1;
    else runs.push({ status, first: index, end: index + 1 });
  });
  return runs;
}
