/** A figure of an athlete's jumps, day by day: dots with their standard deviations, the mean of each day and how his jumps scatter. */

import { number, timeInWords } from "../shared/format.js";

/** @typedef {{ day: string, value: number, sigma: number, good: boolean }} Dot */

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT, LEFT, TOP, BOTTOM] = [340, 190, 44, 8, 24];
/** Room that the label of a day takes. */
const LABEL = 46;
/** Part of a day's room that its jumps take. */
const SPREAD = 0.7;

/**
 * @param {Dot[]} dots oldest first
 * @param {string} words what the drawing says
 */
export function drawChart(dots, words) {
  const days = [...new Set(dots.map(({ day }) => day))];
  const [low, high, step] = rangeOf(dots);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const room = (WIDTH - LEFT - 4) / days.length;
  const y = (/** @type {number} */ value) => TOP + (HEIGHT - TOP - BOTTOM) * (1 - (Math.min(high, Math.max(low, value)) - low) / (high - low));
  const drawing = element("svg", { class: "chart", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": words });
  for (let tick = Math.ceil(low / step) * step; tick <= high + step / 100; tick += step) {
    drawing.append(element("line", { class: "grid", x1: LEFT, x2: WIDTH, y1: y(tick), y2: y(tick) }), label(LEFT - 5, y(tick) + 4, number(tick, digits), "end"));
  }
  const every = Math.ceil((days.length * LABEL) / (WIDTH - LEFT));
  days.forEach((day, place) => {
    const own = dots.filter((dot) => dot.day === day);
    const from = LEFT + place * room;
    drawing.append(...drawMean(own.filter(({ good }) => good), from, room, y), ...own.map((dot, index) => drawDot(dot, from + room * (0.5 + SPREAD * ((index + 0.5) / own.length - 0.5)), y)));
    if ((days.length - 1 - place) % every === 0) drawing.append(label(Math.min(from + room / 2, WIDTH - LABEL / 2), HEIGHT - 7, shortDay(day), "middle"));
  });
  return drawing;
}

/**
 * The mean of a day, and a band of one standard deviation of a jump about it.
 *
 * @param {Dot[]} dots
 * @param {number} from
 * @param {number} room
 * @param {(value: number) => number} y
 */
function drawMean(dots, from, room, y) {
  if (!dots.length) return [];
  const mean = dots.reduce((sum, { value }) => sum + value, 0) / dots.length;
  const scatter = Math.sqrt(dots.reduce((sum, { value }) => sum + (value - mean) ** 2, 0) / (dots.length - 1));
  const ends = { x1: from + room * 0.05, x2: from + room * 0.95, y1: y(mean), y2: y(mean) };
  const line = element("line", { class: "mean", ...ends });
  if (dots.length < 2) return [line];
  const [top, bottom] = [y(mean + scatter), y(mean - scatter)];
  return [element("rect", { class: "band", x: ends.x1, width: room * 0.9, y: top, height: bottom - top }), line];
}

/**
 * @param {Dot} dot
 * @param {number} x
 * @param {(value: number) => number} y
 */
function drawDot({ value, sigma, good }, x, y) {
  const group = element("g", { class: good ? "dot" : "dot doubtful" });
  group.append(element("line", { x1: x, x2: x, y1: y(value - sigma), y2: y(value + sigma) }), element("circle", { cx: x, cy: y(value), r: 3.5 }));
  return group;
}

/**
 * Least and greatest value shown, and the step between two lines: one standard deviation beyond the values, the usual one.
 *
 * @param {Dot[]} dots
 * @returns {[number, number, number]}
 */
function rangeOf(dots) {
  const sigmas = dots.map(({ sigma }) => sigma).sort((one, two) => one - two);
  const beyond = 1.2 * sigmas[Math.floor(sigmas.length / 2)] + 1e-6;
  const values = dots.map(({ value }) => value);
  const [low, high] = [Math.min(...values) - beyond, Math.max(...values) + beyond];
  const rough = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [low, high, power * ([1, 2, 5].find((factor) => factor * power >= rough) ?? 10)];
}

/** @param {string} day */
function shortDay(day) {
  return timeInWords(new Date(`${day}T12:00`), { day: "numeric", month: "short" });
}

/**
 * @param {number} x
 * @param {number} y
 * @param {string} words
 * @param {string} anchor
 */
function label(x, y, words, anchor) {
  const text = element("text", { x, y, "text-anchor": anchor });
  text.textContent = words;
  return text;
}

/**
 * @param {string} name
 * @param {Record<string, string|number>} attributes
 */
function element(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
}
