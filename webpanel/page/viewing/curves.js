/** Quantities of the measured jump over time, with bands of one standard deviation; their cursor is the pulse in sight. */

import { t } from "../i18n/i18n.js";
import { $, make, setText } from "../shared/dom.js";
import { inKmh, withSigma } from "../shared/figures.js";
import { number, quantity } from "../shared/format.js";
import { onShown, pulseShown, showPulse } from "./scrubber.js";

/** @typedef {import("./stick.js").Jump} Jump */
/** @typedef {import("./stick.js").Curve} Curve */
/** @typedef {{ curve: Curve, figure: HTMLElement, plot: HTMLElement, reading: HTMLElement }} Plot */

const SVG = "http://www.w3.org/2000/svg";
/** In this order; on a phone the first two are in sight. */
const ORDER = ["speed", "height", "alpha", "beta", "gamma", "dphi", "phi", "angle_of_attack"];
/** The axis of values reaches so far beyond the curve, as a share of its range. */
const ROOM = 0.06;
/** Bands wider than so many times the usual one are cut off rather than flatten the curve. */
const WIDE = 4;
/** A touch that moves less than this across a curve is a tap, or scrolls the page. */
const TAP_PX = 6;

/** @type {Jump[]} */
let jumps = [];
/** The one whose curves are drawn. @type {Jump|null} */
let shown = null;
/** @type {Plot[]} */
let plots = [];

export function startCurves() {
  $("curves-all").addEventListener("click", () => {
    const all = $("curves").classList.toggle("all");
    $("curves-all").setAttribute("aria-expanded", String(all));
  });
  onShown(follow);
}

/**
 * Draw the curves of the jump in sight from now on.
 *
 * @param {Jump[]} measured none: there are no curves
 */
export function showCurves(measured) {
  jumps = measured.filter(({ pulses }) => pulses.length > 1);
  shown = null;
  $("curves").hidden = jumps.length === 0;
  follow();
}

/** Draw the curves anew, in another language. */
export function drawCurves() {
  shown = null;
  follow();
}

/** Move the cursors to the pulse in sight. */
function follow() {
  const pulse = pulseShown();
  if (!jumps.length || pulse === null) return;
  const now = jumps.find(({ pulses }) => pulses[pulses.length - 1].pulse >= pulse) ?? jumps[jumps.length - 1];
  if (now !== shown) draw(now);
  const at = now.pulses.findIndex((each) => each.pulse === pulse);
  for (const plot of plots) read(plot, now, at);
  const here = now.pulses[at];
  const where = here ? [`${number(here.since_s, 2)}\u202fs`, quantity(here.distance_m, 1, "m")].join("  ·  ") : t("curves.not_in_sight");
  setText($("curves-where"), here?.unsure ? `${where}  ·  ${t("curves.unsure")}` : where);
}

/** @param {Jump} jump */
function draw(jump) {
  shown = jump;
  plots = ORDER.flatMap((name) => {
    const curve = jump.curves.find((each) => each.name === name);
    return curve && curve.value.some((value) => value !== null) ? [makePlot(curve, jump)] : [];
  });
  $("curves-plots").replaceChildren(...plots.map(({ figure }) => figure));
}

/**
 * @param {Curve} curve
 * @param {Jump} jump
 * @returns {Plot}
 */
function makePlot(curve, jump) {
  const [bottom, top] = limits(curve);
  const times = jump.pulses.map(({ since_s }) => since_s);
  const [first, last] = [times[0], times[times.length - 1]];
  const x = (/** @type {number} */ time) => 100 * (time - first) / (last - first);
  const y = (/** @type {number} */ value) => 100 * Math.min(1, Math.max(0, (top - value) / (top - bottom)));
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 100 100");
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("aria-hidden", "true");
  const band = runs(curve).map((run) => {
    const edge = (/** @type {number} */ sign) => run.map((i) => `${x(times[i]).toFixed(2)} ${y(Number(curve.value[i]) + sign * Number(curve.sigma[i])).toFixed(2)}`);
    return `M${[...edge(1), ...edge(-1).reverse()].join("L")}Z`;
  });
  const line = runs(curve).map((run) => `M${run.map((i) => `${x(times[i]).toFixed(2)} ${y(Number(curve.value[i])).toFixed(2)}`).join("L")}`);
  const edge = jump.takeoff && first < 0 && last > 0 ? `M${x(0).toFixed(2)} 0V100` : "";
  for (const [of, d] of Object.entries({ edge, band: band.join(""), line: line.join("") })) {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("class", of);
    path.setAttribute("d", d);
    svg.append(path);
  }
  const plot = make("div", { class: "plot", role: "slider", tabIndex: 0, "aria-label": t(`curves.${curve.name}`), "aria-valuemin": jump.pulses[0].pulse, "aria-valuemax": jump.pulses[times.length - 1].pulse },
    svg, make("i"), make("span", { class: "most" }, shortly(top, curve)), make("span", { class: "least" }, shortly(bottom, curve)));
  const reading = make("strong");
  startDragging(plot, jump);
  return { curve, figure: make("figure", { class: "curve", "data-curve": curve.name }, make("figcaption", {}, make("span", {}, t(`curves.${curve.name}`)), reading), plot), plot, reading };
}

/**
 * Let finger, mouse and keys move the video by a plot.
 *
 * @param {HTMLElement} plot
 * @param {Jump} jump
 */
function startDragging(plot, { pulses }) {
  const last = pulses.length - 1;
  const [begin, span] = [pulses[0].since_s, pulses[last].since_s - pulses[0].since_s];
  /** @param {PointerEvent} event */
  const seek = (event) => {
    const box = plot.getBoundingClientRect();
    const time = begin + span * (event.clientX - box.left) / box.width;
    const nearest = pulses.reduce((best, each) => (Math.abs(each.since_s - time) < Math.abs(best.since_s - time) ? each : best));
    showPulse(nearest.pulse);
  };
  let [dragging, begun] = [false, 0];
  plot.addEventListener("pointerdown", (event) => {
    plot.setPointerCapture(event.pointerId);
    [dragging, begun] = [event.pointerType === "mouse", event.clientX];
    if (dragging) seek(event);
  });
  plot.addEventListener("pointermove", (event) => {
    if (!plot.hasPointerCapture(event.pointerId)) return;
    dragging ||= Math.abs(event.clientX - begun) > TAP_PX; // a finger may only want to scroll the page
    if (dragging) seek(event);
  });
  plot.addEventListener("pointerup", seek);
  plot.addEventListener("keydown", (event) => {
    const at = pulses.findIndex(({ pulse }) => pulse >= (pulseShown() ?? 0));
    const steps = /** @type {Record<string, number>} */ ({ ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10, Home: -Infinity, End: Infinity })[event.key];
    if (!steps || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation(); // the same keys step through the whole recording elsewhere
    showPulse(pulses[Math.min(last, Math.max(0, (at < 0 ? last : at) + steps))].pulse);
  });
}

/**
 * @param {Plot} plot
 * @param {Jump} jump
 * @param {number} at index of the pulse in sight; -1: the jumper is not in sight
 */
function read({ curve, plot, reading }, { pulses }, at) {
  const value = at < 0 ? null : curve.value[at];
  const sigma = at < 0 ? null : curve.sigma[at];
  const words = value === null || sigma === null ? "–" : withSigma({ value, sigma }, curve.unit);
  setText(reading, curve.unit === "m/s" && value !== null ? `${words}  ·  ${inKmh(value)}` : words);
  const [first, last] = [pulses[0].since_s, pulses[pulses.length - 1].since_s];
  plot.classList.toggle("out", at < 0);
  if (at >= 0) plot.style.setProperty("--at", String((pulses[at].since_s - first) / (last - first)));
  plot.setAttribute("aria-valuenow", String(pulses[Math.max(0, at)].pulse));
  plot.setAttribute("aria-valuetext", at < 0 ? t("curves.not_in_sight") : `${number(pulses[at].since_s, 2)} s: ${reading.textContent}`);
}

/**
 * Least and greatest value of the axis.
 *
 * @param {Curve} curve
 * @returns {[number, number]}
 */
function limits({ value, sigma, least }) {
  const known = value.flatMap((each, i) => (each === null ? [] : [{ value: each, sigma: sigma[i] ?? 0 }]));
  const usual = known.map((each) => each.sigma).sort((a, b) => a - b)[Math.floor(known.length / 2)];
  const half = (/** @type {number} */ deviation) => Math.min(deviation, WIDE * usual);
  const bottom = Math.min(...known.map((each) => each.value - half(each.sigma)));
  const top = Math.max(...known.map((each) => each.value + half(each.sigma)));
  const room = Math.max(ROOM * (top - bottom), (least - (top - bottom)) / 2);
  return [bottom - room, top + room];
}

/**
 * Indices of successive pulses that have a value.
 *
 * @param {Curve} curve
 */
function runs({ value }) {
  /** @type {number[][]} */
  const found = [];
  value.forEach((each, i) => {
    if (each === null) return;
    if (i && value[i - 1] !== null) found[found.length - 1].push(i);
    else found.push([i]);
  });
  return found;
}

/**
 * @param {number} value
 * @param {Curve} curve
 */
function shortly(value, { unit }) {
  return unit === "°" ? `${number(value)}°` : quantity(value, 1, unit);
}
