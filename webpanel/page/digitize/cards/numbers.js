/** What follows in space from the marks of this pulse, beside the views: place, sigma, residual and test value of each ray. */

import { say, t } from "../../i18n/i18n.js";
import { $, make, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { cameras, state, watch } from "../session/state.js";
import { cameraColour, colourOf } from "../views/overlay.js";
import { titleOf } from "./things.js";

/** @typedef {import("../types.js").SpacePoint} SpacePoint */

/** A test value over this does not happen by chance, and over the other seldom. */
const [WRONG, SELDOM] = [3.3, 2];
/** Words for how a point or ski is determined, or why it is not. @type {Record<string, string>} */
const STATUS = {
  controlled: "digitize.controlled", "two rays": "digitize.two_rays", "one ray": "digitize.one_ray", "two images": "digitize.two_images", "not measured": "digitize.not_measured",
  "one image": "digitize.one_image", "the rays are parallel within their accuracy": "digitize.parallel", "the rays do not meet before the cameras": "digitize.behind",
};
/** @type {Record<string, [string, string, number]>} sign, unit and decimals of the angles */
const FIGURES = {
  alpha: ["α", "°", 2], beta: ["β", "°", 2], gamma: ["γ", "°", 2], dphi: ["Δφ", "°", 2], phi: ["φ", "°", 2], height: ["Z₀", "\u202fm", 3],
};

/** @param {string} figure @returns {string} its sign */
export function nameOf(figure) {
  return FIGURES[figure]?.[0] ?? figure;
}

export function startNumbers() {
  watch(draw);
}

/** What is shown; it is made anew only when that changes. */
let shown = "";

function draw() {
  const { view, live, thing } = state;
  const space = { ...view?.space, ...live?.geometry.space ? { [thing]: live.geometry.space } : {} };
  const lines = view?.lines ?? {};
  const oriented = state.opening?.cameras.some((camera) => camera.oriented) ?? false;
  const now = JSON.stringify([space, lines, view?.figures, thing, Boolean(live), Boolean(state.dragged), oriented, document.documentElement.lang]);
  // Only of marks: where the pointer happens to be is no mistake.
  drawFindings([...Object.values(view?.space ?? {}), ...Object.values(lines)].flatMap(({ finding }) => finding ? say(finding).text : []));
  if (now === shown) return;
  shown = now;
  const names = Object.keys(space).sort((a, b) => Number(b === thing) - Number(a === thing));
  $("points").replaceChildren(...names.map((name) => makePoint(name, space[name], name === thing && Boolean(live))));
  $("lines").replaceChildren(...Object.entries(lines).map(([name, line]) => makeLine(name, line)));
  $("figures").replaceChildren(...Object.entries(view?.figures ?? {}).map(([name, { value, sigma }]) => {
    const [sign, unit, digits] = FIGURES[name] ?? [name, "", 3];
    return make("div", {}, make("dt", {}, sign), make("dd", {}, `${number(value, digits)} ± ${number(sigma, digits)}${unit}`));
  }));
  $("numbers-none").hidden = names.length > 0 || Object.keys(lines).length > 0;
  setText($("numbers-none"), t(oriented ? "digitize.numbers_none" : "digitize.only_images"));
}

/** @param {string[]} findings rays that do not fit, in words */
function drawFindings(findings) {
  const list = $("findings");
  if (JSON.stringify(findings) === list.dataset.shown) return;
  list.dataset.shown = JSON.stringify(findings);
  list.replaceChildren(...findings.map((words) => make("p", { class: "finding" }, words)));
}

/**
 * @param {string} name
 * @param {SpacePoint} point
 * @param {boolean} live whether it follows the pointer
 */
function makePoint(name, { X, sigma, status, residuals, w, finding }, live) {
  return make("section", { class: "space", "data-of": name, "data-live": String(live) },
    makeHead(name, status, live),
    X && sigma ? make("p", { class: "coordinates" }, ...X.map((value, axis) =>
      make("span", {}, `${"XYZ"[axis]} ${number(value, 3)} ± ${number(sigma[axis], 3)}`))) : null,
    makeRays(w, residuals),
    finding && (!live || state.dragged) ? make("p", { class: "misfit" }, say(finding).text) : null);
}

/** @param {string} name @param {string} status @param {boolean} live */
function makeHead(name, status, live) {
  const dot = make("i", {});
  dot.style.background = colourOf(name);
  return make("p", { class: "space-head" }, dot, make("strong", {}, titleOf(name)), make("span", {}, `${STATUS[status] ? t(STATUS[status]) : status}${live ? ` · ${t("digitize.live")}` : ""}`));
}

/**
 * Residual and test value of each ray.
 *
 * @param {Record<string, number>} w
 * @param {Record<string, [number, number]>} residuals px
 */
function makeRays(w, residuals) {
  const rows = cameras().filter((camera) => camera in w || camera in residuals);
  if (!rows.length) return null;
  return make("ul", { class: "rays" }, ...rows.map((camera) => {
    const value = Math.abs(w[camera] ?? 0);
    const dot = make("i", {});
    dot.style.background = cameraColour(camera);
    const residual = residuals[camera] ? `${number(Math.hypot(...residuals[camera]), 2)} px` : "";
    const test = camera in w ? `w ${number(value, 1)}` : "";
    return make("li", { "data-fit": value > WRONG ? "wrong" : value > SELDOM ? "seldom" : "well" }, dot, make("span", {}, [camera, residual, test].filter(Boolean).join(" · ")));
  }));
}

/**
 * @param {string} name
 * @param {import("../types.js").SpaceLine} line
 */
function makeLine(name, { slope, heading, status, w, finding, sides }) {
  const angle = (/** @type {string} */ words, /** @type {import("../types.js").Estimate|null} */ value) =>
    value ? make("span", {}, `${t(words)} ${number(value.value, 1)} ± ${number(value.sigma, 2)}°`) : null;
  const told = sides && { true: t("digitize.sides_fit"), false: say(sides.said).text, null: t("digitize.sides_unknown") }[String(sides.ok)];
  const lamp = sides ? make("p", { class: "lamp", "data-ok": String(sides.ok) }, make("i", {}), make("span", {}, told ?? "")) : null;
  return make("section", { class: "space", "data-of": name },
    makeHead(name, status, false),
    make("p", { class: "coordinates" }, angle("digitize.slope", slope), angle("digitize.heading", heading)),
    makeRays(w, {}), lamp, finding ? make("p", { class: "misfit" }, say(finding).text) : null);
}
