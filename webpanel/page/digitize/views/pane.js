/**
 * One camera's view: its picture with what is drawn over it, and the hand on it.
 *
 * @typedef {object} Pane
 * @property {HTMLElement} element
 * @property {HTMLCanvasElement} canvas
 * @property {() => void} draw
 * @property {() => Size} box size of the canvas, CSS px
 */

import { t } from "../../i18n/i18n.js";
import { make, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { follow, unfollow } from "../marking/geometry.js";
import { move, place, select, stepCamera, stroke } from "../marking/marking.js";
import { holdTape } from "../marking/tape.js";
import { said } from "../session/advance.js";
import { canBeSideBySide, change, fate, FATES, oneIsLarge, redraw, state, thingOf } from "../session/state.js";
import { frameOf } from "./frames.js";
import { drawLoupe } from "./loupe.js";
import { drawOverlay } from "./overlay.js";
import { paintedBox, watchPointer } from "./pointer.js";
import { CRISP, moved, toImage, toScreen, whole, zoomed } from "./transform.js";

/** @typedef {[number, number]} Size */
/** @typedef {import("../types.js").Place} Place */
/** @typedef {import("../types.js").Mark} Mark */

/** So near to a mark, CSS px, a hand takes it: the mouse, and a finger. */
const [NEAR_MOUSE, NEAR_FINGER] = [12, 26];
/** A stroke along an edge is longer than this, CSS px. */
const STROKE_PX = 40;

/**
 * @param {import("../types.js").ViewedCamera} camera
 * @param {(name: string, change: (lens: import("./transform.js").Lens, image: Size, box: Size) => import("./transform.js").Lens) => void} look
 *   change how it is looked at, with the views that are linked
 * @returns {Pane}
 */
export function makePane({ name, size }, look) {
  const canvas = make("canvas", { tabIndex: 0, role: "img" });
  const fateWords = make("p", { class: "pane-fate", hidden: true });
  const title = make("button", { type: "button", class: "plain pane-name", onclick: () => enlarge(name) }, name);
  const where = make("span", { class: "pane-where" });
  const stated = make("span", { class: "pane-stated" });
  const element = make("figure", { class: "pane", "data-camera": name },
    make("figcaption", {}, title, where, stated), make("div", { class: "pane-picture" }, canvas, fateWords));
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
  const layer = new OffscreenCanvas(1, 1);
  /** What is painted on it. */
  let layerShows = "";
  /** @type {Size} */
  let box = [1, 1];
  /** The mark that the hand has taken, and how far from its middle. @type {{ mark: Mark, dx: number, dy: number }|null} */
  let held = null;
  /** Whether a finger is on a small picture, to make it the large one: it measures nothing. */
  let chosen = false;

  function measure() {
    const { width, height } = paintedBox(canvas);
    if (width !== box[0] || height !== box[1]) box = [Math.max(1, width), Math.max(1, height)];
  }
  new ResizeObserver(() => {
    measure();
    redraw();
  }).observe(canvas);
  // The observer tells of a new size only with the next frame: what the hand does before means the picture as it is by then.
  for (const kind of ["pointerdown", "pointermove", "pointerup", "wheel"]) canvas.addEventListener(kind, measure, { capture: true, passive: true });

  const lens = () => state.lenses[name] ?? whole(size, box);

  /** @param {Place} at @returns {Place} */
  const imageOf = (at) => toImage(lens(), box, at);

  /**
   * The picture as it is seen: painted anew only when it changes, not whenever the pointer moves.
   *
   * @param {CanvasImageSource|null} picture
   * @param {import("./transform.js").Lens} shown
   * @param {number} width of the canvas, its pixels
   * @param {number} height
   */
  function painted(picture, shown, width, height) {
    const now = JSON.stringify([picture !== null, state.pulse, state.difference, state.tone, shown, box, width, height]);
    if (now === layerShows) return layer;
    layerShows = now;
    Object.assign(layer, { width, height });
    const paper = /** @type {OffscreenCanvasRenderingContext2D} */ (layer.getContext("2d", { alpha: false }));
    paper.fillStyle = "#05090e";
    paper.fillRect(0, 0, width, height);
    if (!picture) return layer;
    const [kx, ky] = [width / box[0], height / box[1]];
    const [x, y] = toScreen(shown, box, [-0.5, -0.5]);
    paper.setTransform(kx * shown.scale, 0, 0, ky * shown.scale, kx * x, ky * y);
    paper.imageSmoothingEnabled = shown.scale <= CRISP;
    paper.imageSmoothingQuality = "high"; // what is simpler moves the picture by a thirtieth of its pixels
    paper.drawImage(picture, 0, 0);
    return layer;
  }

  function draw() {
    const [width, height] = box.map((length) => Math.round(length * devicePixelRatio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const [shown, frame] = [lens(), frameOf(name)];
    const [kx, ky] = [width / box[0], height / box[1]];
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(painted(frame?.picture ?? null, shown, width, height), 0, 0);
    context.setTransform(kx, 0, 0, ky, 0, 0);
    drawOverlay(context, name, (xy) => toScreen(shown, box, xy));
    const { hover, dragged } = state;
    if (frame && hover?.camera === name) {
      const xy = dragged?.camera === name ? dragged.xy : hover.xy;
      const at = toScreen(shown, box, xy);
      if (!hover.pointer) drawCrosshair(at);
      drawLoupe(context, { picture: frame.picture, xy, at, box, scale: shown.scale, finger: hover.finger }, (inside, project) => drawOverlay(inside, name, project));
    }
    drawWords(frame !== null, shown.scale);
  }

  /** @param {Place} at where the keys would place the thing */
  function drawCrosshair([x, y]) {
    for (const [colour, wide] of /** @type {[string, number][]} */ ([["#05090e", 3], ["#ffffff", 1]])) {
      context.beginPath();
      for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
        context.moveTo(x + 4 * dx, y + 4 * dy);
        context.lineTo(x + 22 * dx, y + 22 * dy);
      }
      Object.assign(context, { strokeStyle: colour, lineWidth: wide });
      context.stroke();
    }
  }

  /** @param {boolean} there @param {number} scale */
  function drawWords(there, scale) {
    const gone = fate(name) !== "o";
    const words = t(FATES[fate(name)]);
    fateWords.hidden = !gone && there;
    element.dataset.fate = fate(name);
    setText(fateWords, gone ? `${words}: ${t(`${FATES[fate(name)]}.means`)}` : there ? "" : t("digitize.loading"));
    setText(where, gone ? `${state.pulse} · ${words}` : `${state.pulse} · ${number(scale, scale < 10 ? 1 : 0)}×`);
    const told = Object.keys(state.view?.marks[name] ?? {}).flatMap((thing) => {
      const how = said(state.view, name, thing)?.state;
      return how === "hidden" || how === "not visible" ? [`${thing.replace(/^\w+:/, "")} ${t(how === "hidden" ? "digitize.hidden" : "digitize.not_visible")}`] : [];
    });
    setText(stated, told.join(", "));
    element.classList.toggle("active", state.camera === name);
    title.setAttribute("aria-pressed", String(state.camera === name));
    const label = t("digitize.picture_of", { camera: name, pulse: String(state.pulse), fate: words });
    if (canvas.getAttribute("aria-label") !== label) canvas.setAttribute("aria-label", label);
  }

  /**
   * The mark that is taken at a place: of the selected thing before others.
   *
   * @param {Place} at
   * @param {boolean} finger
   */
  function take(at, finger) {
    const names = Object.keys(state.view?.marks[name] ?? {}).sort((a, b) => Number(b === state.thing) - Number(a === state.thing));
    for (const thing of names) {
      for (const mark of said(state.view, name, thing)?.marks ?? []) {
        if (!mark.xy) continue;
        const [x, y] = toScreen(lens(), box, mark.xy);
        if (Math.hypot(x - at[0], y - at[1]) > (finger ? NEAR_FINGER : NEAR_MOUSE)) continue;
        return { mark, dx: x - at[0], dy: y - at[1] };
      }
    }
    return null;
  }

  /** @param {Place} at @param {boolean} finger */
  function hover(at, finger) {
    const xy = imageOf(at);
    change({ hover: { camera: name, xy, finger, pointer: true } });
    if (fate(name) === "o" && !state.tape) follow(name, state.thing, xy);
  }

  watchPointer(canvas, {
    hover,
    leave() {
      if (state.hover?.camera !== name) return;
      change({ hover: null });
      unfollow();
    },
    press(at, finger) {
      chosen = finger && oneIsLarge() && state.camera !== name;
      if (chosen) return;
      if (state.camera !== name) change({ camera: name, vertex: null });
      held = state.tape ? null : take(at, finger);
      hover(at, finger);
    },
    drag(at, finger) {
      if (chosen) return;
      hover(at, finger);
      if (!held) return;
      const { mark, dx, dy } = held;
      const xy = imageOf([at[0] + dx, at[1] + dy]);
      change({ dragged: { camera: name, thing: mark.thing, vertex: mark.vertex, xy } });
      follow(name, mark.thing, xy);
    },
    release(at, begun, path) {
      if (chosen) return select({ camera: name });
      const [taken, dragged] = [held, state.dragged];
      held = null;
      change({ dragged: null });
      if (fate(name) !== "o") return;
      if (state.tape) return void holdTape(name, imageOf(at));
      if (dragged && taken) return move(taken.mark, dragged.xy);
      const drawn = path.length > 2 && Math.hypot(at[0] - begun[0], at[1] - begun[1]) > STROKE_PX;
      if (drawn && thingOf()?.kind === "line") return void stroke(name, path.map(imageOf));
      place(name, imageOf(at));
    },
    cancel() {
      held = null;
      change({ dragged: null });
      unfollow();
    },
    pan: (dx, dy) => look(name, (now, image, its) => moved(now, image, its, dx, dy)),
    zoom: (factor, at) => look(name, (now, image, its) => zoomed(now, image, its, factor, its === box ? at : undefined)),
  });

  return { element, canvas, draw, box: () => box };
}

/**
 * Make a view the active one, and the large one; the one that is large already gives way to all side by side, on a phone
 * to the next one.
 *
 * @param {string} name
 */
function enlarge(name) {
  if (state.camera !== name) select({ camera: name });
  else if (canBeSideBySide()) change({ large: !state.large });
  else stepCamera(1);
}
