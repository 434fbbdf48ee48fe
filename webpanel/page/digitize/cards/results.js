/** Computes the jump from what is measured by hand, and shows its curves with their bands; a click goes to the pulse. */

import { say, t } from "../../i18n/i18n.js";
import { $, icon, make, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { attempt } from "../../shared/snacks.js";
import { select } from "../marking/marking.js";
import { cancelComputing, compute, getResult, resultFile } from "../session/server.js";
import { state, watch } from "../session/state.js";

/** @typedef {import("../types.js").CurvePoint} CurvePoint */

const SVG = "http://www.w3.org/2000/svg";
const LOOK_AGAIN_MS = 1000;
/** Units of a drawing: it is stretched to its frame. */
const [WIDTH, HEIGHT] = [1000, 100];
/** @type {Record<string, string>} */
const SIGNS = { alpha: "α, °", beta: "β, °", gamma: "γ, °", dphi: "Δφ, °", phi: "φ, °", height: "Z₀, m", speed: "v, m/s" };

/** @type {import("../types.js").HandResult|null} */
let result = null;
let looking = "";
/** The curves that are drawn, to move the line of the pulse in sight. @type {{ plot: HTMLElement, points: CurvePoint[] }[]} */
let plots = [];

export function startResults() {
  $("compute").addEventListener("click", () => void begin());
  $("compute-cancel").addEventListener("click", () => void cancel());
  watch(() => {
    if (state.operator && looking !== state.operator) void follow(state.operator);
    for (const { plot, points } of plots) {
      const [first, last] = [points[0].pulse, points[points.length - 1].pulse];
      plot.style.setProperty("--at", String((state.pulse - first) / Math.max(1, last - first)));
      plot.classList.toggle("out", state.pulse < first || state.pulse > last);
    }
  });
}

/** Compute; the result comes when it is there. */
export async function begin() {
  const answer = await attempt(() => compute(state.operator));
  if (!answer) return;
  show(answer);
  await follow(state.operator);
}

async function cancel() {
  const answer = await attempt(() => cancelComputing(state.operator));
  if (answer) show(answer);
}

/** @param {string} operator whose result is looked at until it is there */
async function follow(operator) {
  looking = operator;
  for (;;) {
    const answer = await attempt(() => getResult(operator));
    if (operator !== state.operator || !answer) return;
    show(answer);
    if (answer.state !== "computing") return;
    await new Promise((resolve) => { setTimeout(resolve, LOOK_AGAIN_MS); });
  }
}

/** Draw the result, perhaps in another language. */
export function drawResult() {
  if (result) show(result);
}

/** @param {import("../types.js").HandResult} now */
function show(now) {
  result = now;
  const words = { none: "digitize.result_none", computing: "digitize.result_computing", done: "digitize.result_done", failed: "digitize.result_failed" }[now.state];
  const computing = now.state === "computing";
  const doing = now.paused ? t("digitize.result_paused") : now.step && t(`measurement.step_${now.step}`);
  setText($("result-state"), [t(words), computing ? doing : now.problem ? say(now.problem).text : now.said.map((each) => say(each).text).join("; ")].filter(Boolean).join(" "));
  $("compute").disabled = computing;
  $("compute-cancel").hidden = $("result-share").hidden = !computing;
  $("result-share").value = now.share;
  const curves = Object.entries(now.curves).filter(([, points]) => points.length);
  plots = [];
  $("curves").replaceChildren(...curves.map(([name, points]) => makeCurve(name, points)));
  $("result-files").replaceChildren(...now.files.map((name) => make("a", {
    class: "button", href: resultFile(state.operator, name), ...name.endsWith(".html") ? { target: "_blank", rel: "noopener" } : { download: "" },
  }, icon(name.endsWith(".html") ? "log" : "download"), make("span", {}, name === "report.html" ? t("measurement.report") : name))));
}

/** @param {string} name @param {CurvePoint[]} points */
function makeCurve(name, points) {
  const [low, high] = [Math.min(...points.map(({ value, sigma }) => value - 2 * sigma)), Math.max(...points.map(({ value, sigma }) => value + 2 * sigma))];
  const [first, last] = [points[0].pulse, points[points.length - 1].pulse];
  const x = (/** @type {CurvePoint} */ { pulse }) => (WIDTH * (pulse - first) / Math.max(1, last - first)).toFixed(1);
  const y = (/** @type {number} */ value) => (HEIGHT * (high - value) / (high - low || 1)).toFixed(2);
  const along = (/** @type {1|0|-1} */ side, /** @type {CurvePoint[]} */ of) => of.map((point) => `${x(point)},${y(point.value + 2 * side * point.sigma)}`).join("L");
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("aria-hidden", "true");
  for (const [kind, d] of [["band", `M${along(1, points)}L${along(-1, points.toReversed())}Z`], ["line", `M${along(0, points)}`]]) {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("class", kind);
    path.setAttribute("d", d);
    svg.append(path);
  }
  const plot = make("button", { type: "button", class: "plot", "aria-label": t("digitize.curve", { name: SIGNS[name] ?? name }) },
    svg, make("i", {}), make("span", { class: "most" }, number(high, 1)), make("span", { class: "least" }, number(low, 1)));
  plot.addEventListener("click", (/** @type {MouseEvent} */ event) => {
    if (!event.detail) return; // pressed by a key: there is no place
    const box = plot.getBoundingClientRect();
    const wanted = first + (last - first) * (event.clientX - box.left) / box.width;
    select({ pulse: points.reduce((best, one) => Math.abs(one.pulse - wanted) < Math.abs(best.pulse - wanted) ? one : best).pulse });
  });
  plot.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const next = step > 0 ? points.find(({ pulse }) => pulse > state.pulse) : points.findLast(({ pulse }) => pulse < state.pulse);
    if (next) select({ pulse: next.pulse });
  });
  plots.push({ plot, points });
  return make("figure", { class: "curve" }, make("figcaption", {}, SIGNS[name] ?? name), plot);
}
