/**
 * Curves of all quantities with their bands, which follow what is measured; a click on one goes to the pulse.
 *
 * The service computes them in the background. The page asks while somebody sees them, and one question is under way at
 * a time: marks made meanwhile are in the next one.
 *
 * @typedef {import("../types.js").CurvePoint} CurvePoint
 * @typedef {object} Drawing of one quantity
 * @property {HTMLElement} figure
 * @property {(points: CurvePoint[]) => void} draw anew; what has the focus keeps it
 * @property {() => void} point to the pulse in sight
 */

import { say, t } from "../../i18n/i18n.js";
import { $, make, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { attempt } from "../../shared/snacks.js";
import { load, save } from "../../shared/store.js";
import { select } from "../marking/marking.js";
import { getCurves } from "../session/server.js";
import { state, watch } from "../session/state.js";

const SVG = "http://www.w3.org/2000/svg";
const LOOK_AGAIN_MS = 400;
/** Units of a drawing: it is stretched to its frame. */
const [WIDTH, HEIGHT] = [1000, 100];
/** @type {Record<string, string>} */
const SIGNS = { alpha: "α, °", beta: "β, °", gamma: "γ, °", dphi: "Δφ, °", phi: "φ, °", height: "Z₀, m", speed: "v, m/s", angle_of_attack: "∠v, °" };

/** Beside lists, where a low screen needs its height for the pictures: there they are shown when they are asked for. */
const LOW = "(min-width: 1200px) and (max-height: 819px)";

/** By quantity. @type {Map<string, Drawing>} */
const drawings = new Map();
/** @type {import("../types.js").HandCurves|null} */
let known = null;
/** What the curves that are known come from, or the ones that are asked for. */
let asked = "";
let underWay = false;

export function startCurves() {
  const card = $("following");
  card.open = load("digitize.curves", !matchMedia(LOW).matches);
  card.querySelector("summary").addEventListener("click", () => save("digitize.curves", !card.open));
  card.addEventListener("toggle", follow);
  document.addEventListener("visibilitychange", follow);
  watch(() => {
    follow();
    for (const { point } of drawings.values()) point();
  });
}

/** What curves should come from. */
function wanted() {
  return [state.operator, state.session?.revision, state.opening?.orientation.state].join(" ");
}

/** Ask for the curves of the newest marks, until they are there. */
function follow() {
  if (!underWay && asked !== wanted() && state.session && $("following").open && !document.hidden) void ask();
}

async function ask() {
  underWay = true;
  try {
    const { operator } = state;
    if (!asked.startsWith(`${operator} `)) show(null);
    const now = wanted();
    const answer = await attempt(() => getCurves(operator));
    if (operator === state.operator && answer) show(answer);
    if (!answer || answer.state !== "computing") asked = now;
    else await new Promise((resolve) => { setTimeout(resolve, LOOK_AGAIN_MS); });
  } finally {
    underWay = false;
  }
  follow();
}

/** Draw the curves, perhaps in another language. */
export function drawCurves() {
  show(known);
}

/** @param {import("../types.js").HandCurves|null} now */
function show(now) {
  known = now;
  const curves = Object.entries(now?.curves ?? {}).filter(([, points]) => points.length);
  const names = curves.map(([name]) => name);
  for (const name of drawings.keys()) if (!names.includes(name)) drawings.delete(name);
  for (const [name, points] of curves) {
    if (!drawings.has(name)) drawings.set(name, makeCurve(name));
    drawings.get(name)?.draw(points);
  }
  const figures = names.map((name) => /** @type {Drawing} */ (drawings.get(name)).figure);
  if (figures.some((figure, index) => $("curves").children[index] !== figure) || figures.length !== $("curves").children.length) $("curves").replaceChildren(...figures);
  $("curves").setAttribute("aria-busy", String(now?.state === "computing"));
  $("curves").dataset.revision = String(now?.revision ?? 0);
  const why = now?.problem ? say(now.problem).text : figures.length || !now?.said.length ? "" : now.said.map((each) => say(each).text).join("; ");
  setText($("curves-say"), now?.state === "computing" ? t(now.paused ? "digitize.result_paused" : "digitize.curves_follow") : why);
}

/** @param {string} name @returns {Drawing} */
function makeCurve(name) {
  /** @type {CurvePoint[]} */
  let points = [];
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("aria-hidden", "true");
  const [band, line] = ["band", "line"].map((kind) => {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("class", kind);
    svg.append(path);
    return path;
  });
  const [most, least] = ["most", "least"].map((kind) => make("span", { class: kind }));
  const plot = make("button", { type: "button", class: "plot" }, svg, make("i", {}), most, least);
  const ends = () => [points[0].pulse, points[points.length - 1].pulse];

  /** @param {CurvePoint[]} now */
  function draw(now) {
    points = now;
    const [low, high] = [Math.min(...points.map(({ value, sigma }) => value - 2 * sigma)), Math.max(...points.map(({ value, sigma }) => value + 2 * sigma))];
    const [first, last] = ends();
    const x = (/** @type {CurvePoint} */ { pulse }) => (WIDTH * (pulse - first) / Math.max(1, last - first)).toFixed(1);
    const y = (/** @type {number} */ value) => (HEIGHT * (high - value) / (high - low || 1)).toFixed(2);
    const along = (/** @type {1|0|-1} */ side, /** @type {CurvePoint[]} */ of) => of.map((one) => `${x(one)},${y(one.value + 2 * side * one.sigma)}`).join("L");
    band.setAttribute("d", `M${along(1, points)}L${along(-1, points.toReversed())}Z`);
    line.setAttribute("d", `M${along(0, points)}`);
    setText(most, number(high, 1));
    setText(least, number(low, 1));
    plot.setAttribute("aria-label", t("digitize.curve", { name: SIGNS[name] ?? name }));
    point();
  }

  function point() {
    const [first, last] = ends();
    plot.style.setProperty("--at", String((state.pulse - first) / Math.max(1, last - first)));
    plot.classList.toggle("out", state.pulse < first || state.pulse > last);
  }

  plot.addEventListener("click", (/** @type {MouseEvent} */ event) => {
    if (!event.detail) return; // pressed by a key: there is no place
    const box = plot.getBoundingClientRect();
    const [first, last] = ends();
    const at = first + (last - first) * (event.clientX - box.left) / box.width;
    select({ pulse: points.reduce((best, one) => Math.abs(one.pulse - at) < Math.abs(best.pulse - at) ? one : best).pulse });
  });
  plot.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const next = step > 0 ? points.find(({ pulse }) => pulse > state.pulse) : points.findLast(({ pulse }) => pulse < state.pulse);
    if (next) select({ pulse: next.pulse });
  });
  return { figure: make("figure", { class: "curve", "data-of": name }, make("figcaption", {}, SIGNS[name] ?? name), plot), draw, point };
}
