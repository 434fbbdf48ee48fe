/** The views of all cameras: side by side, or one large; zoomed and moved together or each by itself. */

import { t } from "../../i18n/i18n.js";
import { $, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { follow } from "../marking/geometry.js";
import { place } from "../marking/marking.js";
import { holdTape } from "../marking/tape.js";
import { said } from "../session/advance.js";
import { canBeSideBySide, change, oneIsLarge, state, thingOf, watch } from "../session/state.js";
import { fetchFrames } from "./frames.js";
import { makePane } from "./pane.js";
import { bounded, moved, toImage, toScreen, whole, zoomed } from "./transform.js";

/** @typedef {import("./transform.js").Lens} Lens */
/** @typedef {import("./transform.js").Size} Size */

/** How far arrows move the picture, CSS px, and how keys zoom. */
const [PAN_PX, ZOOM] = [64, Math.SQRT2];

/** @type {Map<string, { pane: import("./pane.js").Pane, size: Size }>} */
const panes = new Map();

/** Make the views; the cameras of the log are known. */
export function startPanes() {
  for (const camera of state.opening?.cameras ?? []) panes.set(camera.name, { pane: makePane(camera, look), size: camera.size });
  $("panes").replaceChildren(...[...panes.values()].map(({ pane }) => pane.element));
  $("panes").style.setProperty("--others", String(Math.max(1, panes.size - 1)));
  for (const name of /** @type {const} */ (["large", "linked", "ghost", "difference"])) {
    $(`view-${name}`).addEventListener("click", () => change({ [name]: !state[name] }));
  }
  $("zoom-in").addEventListener("click", () => zoom(ZOOM));
  $("zoom-out").addEventListener("click", () => zoom(1 / ZOOM));
  $("zoom-whole").addEventListener("click", showWhole);
  $("zoom-thing").addEventListener("click", centre);
  $("loupe").addEventListener("change", () => change({ loupe: Number($("loupe").value) }));
  watch(draw);
}

function draw() {
  fetchFrames();
  $("panes").classList.toggle("one", oneIsLarge());
  $("view-large").hidden = !canBeSideBySide();
  for (const name of /** @type {const} */ (["large", "linked", "ghost", "difference"])) {
    $(`view-${name}`).setAttribute("aria-pressed", String(state[name]));
  }
  $("loupe").value = String(state.loupe);
  for (const { pane } of panes.values()) pane.draw();
  setText($("cursor-where"), state.hover ? t("digitize.where", {
    camera: state.hover.camera, x: number(state.hover.xy[0], 2), y: number(state.hover.xy[1], 2),
  }) : "");
}

/**
 * Change how a camera is looked at, and with linked views all of them.
 *
 * @param {string} camera
 * @param {(lens: Lens, image: Size, box: Size) => Lens} changed
 */
function look(camera, changed) {
  const lenses = { ...state.lenses };
  for (const [name, { pane, size }] of panes) {
    if (name === camera || state.linked) lenses[name] = changed(lensOf(name), size, pane.box());
  }
  change({ lenses });
}

/** @param {string} name */
function lensOf(name) {
  const { pane, size } = /** @type {{ pane: import("./pane.js").Pane, size: Size }} */ (panes.get(name));
  return state.lenses[name] ?? whole(size, pane.box());
}

/** @param {number} factor about the crosshair or the middle */
function zoom(factor) {
  const { hover, camera } = state;
  const pane = panes.get(camera)?.pane;
  const at = hover?.camera === camera && pane ? toScreen(lensOf(camera), pane.box(), hover.xy) : undefined;
  look(camera, (lens, image, box) => zoomed(lens, image, box, factor, box === pane?.box() ? at : undefined));
}

export const zoomIn = () => zoom(ZOOM);
export const zoomOut = () => zoom(1 / ZOOM);

/** Show the whole images. */
export function showWhole() {
  if (state.linked) return change({ lenses: {} });
  const { [state.camera]: _, ...lenses } = state.lenses;
  change({ lenses });
}

/**
 * Move the picture of the active view.
 *
 * @param {number} right 1: what is farther right comes into sight
 * @param {number} down
 */
export function pan(right, down) {
  look(state.camera, (lens, image, box) => moved(lens, image, box, -right * PAN_PX, -down * PAN_PX));
}

/** Bring the selected thing into the middle of all views: its mark, where it is predicted, or as it was measured automatically. */
export function centre() {
  const lenses = { ...state.lenses };
  for (const [name, { pane, size }] of panes) {
    const xy = placeIn(name);
    if (xy) lenses[name] = bounded({ ...lensOf(name), scale: Math.max(lensOf(name).scale, 4), x: xy[0], y: xy[1] }, size, pane.box());
  }
  change({ lenses });
}

/** @param {string} camera @returns {[number, number]|null} where the selected thing is, or may be */
function placeIn(camera) {
  const { view, thing } = state;
  const mark = said(view, camera, thing)?.marks.findLast(({ xy }) => xy);
  const automatic = view?.automatic[camera]?.[thing]?.xy;
  const found = mark?.xy ?? view?.predicted[camera]?.[thing]?.xy ?? (Array.isArray(automatic?.[0]) ? automatic[0] : automatic);
  return /** @type {[number, number]|null} */ (found ?? null);
}

/**
 * Move the crosshair of the keys in the active view; without one, it begins where the thing may be, or in the middle.
 *
 * @param {number} dx CSS px
 * @param {number} dy
 */
export function moveCrosshair(dx, dy) {
  const { camera, hover } = state;
  const pane = panes.get(camera)?.pane;
  if (!pane) return;
  const [lens, box] = [lensOf(camera), pane.box()];
  const from = hover?.camera === camera ? hover.xy : placeIn(camera) ?? /** @type {[number, number]} */ ([lens.x, lens.y]);
  const step = hover?.camera === camera ? [dx, dy] : [0, 0];
  const [x, y] = toScreen(lens, box, from);
  const at = /** @type {[number, number]} */ ([x + step[0], y + step[1]]);
  const xy = toImage(lens, box, at);
  change({ hover: { camera, xy, finger: false, pointer: false } });
  if (!state.tape) follow(camera, state.thing, xy);
  const out = [Math.min(0, at[0]) + Math.max(0, at[0] - box[0]), Math.min(0, at[1]) + Math.max(0, at[1] - box[1])];
  if (out[0] || out[1]) look(camera, (now, image, its) => moved(now, image, its, -out[0], -out[1]));
}

/** Place the selected thing, or the end of the tape, at the crosshair. */
export function placeAtCrosshair() {
  const { hover, camera } = state;
  if (hover?.camera !== camera) return moveCrosshair(0, 0);
  if (state.tape) void holdTape(camera, hover.xy);
  else if (thingOf()) place(camera, hover.xy);
}
