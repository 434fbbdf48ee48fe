/** What a hand does: place, move, refine, state, remove, accept; and what is selected then. */

import { Problem } from "../../shared/api.js";
import { tellProblem } from "../../shared/snacks.js";
import { complete, next, said } from "../session/advance.js";
import { refine } from "../session/server.js";
import { send, showPulse } from "../session/session.js";
import { cameras, change, fate, listed, state, thingOf } from "../session/state.js";

/** @typedef {import("../types.js").Place} Place */
/** @typedef {import("../types.js").Mark} Mark */
/** @typedef {import("../session/server.js").PlaceAction} PlaceAction */

/** Standard deviation of a click by hand, px, where none is given: as in the service. */
export const BY_HAND = 0.5;
/** A line that the automatic measurement found, or that was drawn along an edge, is kept by so many points. */
const LINE_POINTS = 5;

/** What was placed last: keys act on it while the thing after it has no mark. @type {{ pulse: number, camera: string, thing: string }|null} */
let last = null;

/**
 * Select a thing, a view or a pulse by hand.
 *
 * @param {{ thing?: string, camera?: string, pulse?: number }} spot
 */
export function select({ thing = state.thing, camera = state.camera, pulse = state.pulse }) {
  last = null;
  showPulse(pulse);
  if (state.hover && !state.hover.pointer && state.hover.camera !== camera) change({ hover: null, live: null });
  change({ thing, camera, vertex: null, group: thingOf(thing)?.group ?? state.group });
}

/** The mark on which keys act: of the selected thing in the active view, else the one placed last. @returns {Mark|null} */
export function target() {
  return markOf(state.camera, state.thing, state.vertex) ?? (last?.pulse === state.pulse ? markOf(last.camera, last.thing, null) : null);
}

/**
 * @param {string} camera
 * @param {string} thing
 * @param {number|null} vertex null: the last one
 * @returns {Mark|null}
 */
function markOf(camera, thing, vertex) {
  const marks = said(state.view, camera, thing)?.marks.filter(({ xy }) => xy) ?? [];
  return marks.find((mark) => vertex !== null && mark.vertex === vertex) ?? marks.at(-1) ?? null;
}

/**
 * Place the selected thing, and select the next one.
 *
 * @param {string} camera
 * @param {Place} xy
 */
export function place(camera, xy) {
  if (!state.operator || !state.thing || fate(camera) !== "o") return;
  put({ camera, thing: state.thing, vertex: null }, { xy });
  goOn(camera);
}

/**
 * @param {{ camera: string, thing: string, vertex: number|null }} where
 * @param {{ xy: Place, sigma?: [number, number]|null, source?: PlaceAction["source"], state?: "measured"|"guess" }} what
 */
function put({ camera, thing, vertex }, { xy, sigma = null, source = "hand", state: how = state.guess ? "guess" : "measured" }) {
  const place = /** @type {Place} */ (xy.map((value) => Math.round(value * 1e4) / 1e4));
  return send({ do: "place", pulse: state.pulse, camera, thing, xy: place, vertex, state: how, source, sigma });
}

/** @param {string} camera in which something was said of the selected thing */
function goOn(camera) {
  const { pulse, thing, advance } = state;
  last = { pulse, camera, thing };
  change({ camera, guess: false, vertex: null });
  const shown = thingOf();
  if (!shown || !complete(state.view, camera, shown)) return;
  const spot = next({ pulse, camera, thing }, advance, {
    things: listed().map(({ name }) => name), cameras: cameras(), pulses: state.opening?.pulses ?? [], open: isOpen,
  });
  showPulse(spot.pulse);
  change({ camera: spot.camera, thing: spot.thing });
}

/**
 * Whether nothing is said yet of a thing in an image.
 *
 * @param {{ pulse: number, camera: string, thing: string }} spot
 */
export function isOpen({ pulse, camera, thing }) {
  if (fate(camera, pulse) !== "o") return false;
  const known = thingOf(thing);
  if (pulse === state.pulse && state.view && known) return !complete(state.view, camera, known);
  return !state.session?.coverage[thing]?.[camera]?.[pulse];
}

/**
 * Move a mark.
 *
 * @param {Mark} mark
 * @param {Place} xy
 */
export function move(mark, xy) {
  const { camera, thing, vertex, sigma } = mark;
  void put({ camera, thing, vertex }, { xy, sigma: mark.source === "hand" ? sigma : null, state: mark.state === "guess" ? "guess" : "measured" });
  change({ camera, thing, vertex, group: thingOf(thing)?.group ?? state.group });
}

/**
 * Draw a line along an edge or a thin bar: two points where the image has it, else points of the hand at equal distances.
 * It takes the place of what was measured of the line. Where others show it too, it is then found in all images at once.
 *
 * @param {string} camera
 * @param {Place[]} path
 */
export async function stroke(camera, path) {
  const [first, end] = [path[0], path[path.length - 1]];
  const { thing, pulse } = state;
  const found = await onLine(camera, first, end);
  if (state.pulse !== pulse || state.thing !== thing) return;
  const byHand = Array.from({ length: LINE_POINTS }, (_, index) => {
    const share = index / (LINE_POINTS - 1);
    return path.reduce((best, one) => away(one, first, end, share) < away(best, first, end, share) ? one : best);
  });
  if (said(state.view, camera, thing)) void send({ do: "remove", pulse, camera, thing, vertex: null });
  if (found?.end) for (const xy of [found.xy, found.end]) void put({ camera, thing, vertex: null }, { xy, sigma: found.sigma, source: "refined" });
  else for (const xy of byHand) void put({ camera, thing, vertex: null }, { xy });
  goOn(camera);
  change({ drawn: { thing, pulse } });
}

/** @param {Place} one @param {Place} first @param {Place} end @param {number} share of the way */
function away(one, first, end, share) {
  return Math.hypot(one[0] - first[0] - share * (end[0] - first[0]), one[1] - first[1] - share * (end[1] - first[1]));
}

/** @param {string} camera @param {Place} begin @param {Place} end */
async function onLine(camera, [x, y], end) {
  try {
    return await refine({ pulse: state.pulse, camera, x, y, end, kind: "line" });
  } catch (error) {
    if (error instanceof Problem && error.status === 422) return null; // no edge there: the hand's places stay
    throw error;
  }
}

/** Find the mark on which keys act more exactly in the image: centre of a disc, or edge. */
export async function refineTarget() {
  const mark = target();
  if (!mark?.xy) return;
  const [{ camera, pulse, thing, vertex }, [x, y]] = [mark, mark.xy];
  const kinds = /** @type {("disc"|"dark disc"|"edge")[]} */ (thingOf(thing)?.kind === "line" ? ["edge"] : ["disc", "dark disc"]);
  /** @type {Problem|null} */
  let refused = null;
  for (const kind of kinds) {
    try {
      const { xy, sigma } = await refine({ pulse, camera, x, y, kind });
      if (pulse === state.pulse) void put({ camera, thing, vertex }, { xy, sigma, source: "refined", state: "measured" });
      return;
    } catch (error) {
      if (!(error instanceof Problem) || error.status !== 422) return tellProblem(error);
      refused ??= error;
    }
  }
  tellProblem(refused);
}

/**
 * Move the mark on which keys act.
 *
 * @param {number} dx px of the image
 * @param {number} dy
 * @returns {boolean} whether there is one
 */
export function nudge(dx, dy) {
  const mark = target();
  if (!mark?.xy) return false;
  const { camera, thing, vertex, sigma, state: how } = mark;
  void put({ camera, thing, vertex }, { xy: [mark.xy[0] + dx, mark.xy[1] + dy], sigma, state: how === "guess" ? "guess" : "measured" });
  return true;
}

/** @param {number} sigma px, of the mark on which keys act */
export function setSigma(sigma) {
  const mark = target();
  if (!mark?.xy || !(sigma > 0)) return;
  const value = Math.min(100, Math.max(0.01, Math.round(sigma * 1000) / 1000));
  const source = mark.source === "tracked" ? "hand" : mark.source;
  void put(mark, { xy: mark.xy, sigma: [value, value], source, state: mark.state === "guess" ? "guess" : "measured" });
}

/** Make a guess of the mark on which keys act, or a measured one again; without a mark: of the next one that is placed. */
export function toggleGuess() {
  const mark = markOf(state.camera, state.thing, state.vertex);
  if (!mark?.xy) return change({ guess: !state.guess });
  void put(mark, { xy: mark.xy, sigma: mark.sigma, state: mark.state === "guess" ? "measured" : "guess" });
}

/** @param {"hidden"|"not visible"} how why the selected thing cannot be measured in the active view */
export function setState(how) {
  const { pulse, camera, thing } = state;
  if (!state.operator || !thing) return;
  void send({ do: "state", pulse, camera, thing, state: how });
  goOn(camera);
}

/** Take the mark on which keys act away, or what was said instead. */
export function remove() {
  const mark = target();
  const { camera, thing } = mark ?? state;
  if (!said(state.view, camera, thing)) return;
  const one = state.vertex !== null && thing === state.thing;
  void send({ do: "remove", pulse: state.pulse, camera, thing, vertex: one ? state.vertex : null });
  select({ thing, camera });
}

/** @param {boolean} all of this pulse, in all views; or the selected thing in the active one */
export async function accept(all) {
  const spots = all
    ? cameras().flatMap((camera) => Object.keys(state.view?.automatic[camera] ?? {}).map((thing) => ({ camera, thing })))
    : [{ camera: state.camera, thing: state.thing }];
  for (const { camera, thing } of spots) {
    const found = state.view?.automatic[camera]?.[thing];
    if (!found || all && said(state.view, camera, thing)) continue; // what a hand has measured stays
    if ("sigma" in found) void put({ camera, thing, vertex: null }, { xy: found.xy, sigma: found.sigma, source: "automatic", state: "measured" });
    else {
      const sigma = /** @type {[number, number]} */ ([found.across, found.across]);
      found.vertices.forEach((xy, vertex) => void put({ camera, thing, vertex }, { xy, sigma, source: "automatic", state: "measured" }));
    }
  }
  if (!all && state.view?.automatic[state.camera]?.[state.thing]) goOn(state.camera);
}

/** Select the thing before or after. @param {1|-1} step */
export function stepThing(step) {
  const things = listed();
  const at = things.findIndex(({ name }) => name === state.thing);
  const found = things[(at + step + things.length) % things.length];
  if (found) select({ thing: found.name });
}

/** Make the view before or after the active one. @param {1|-1} step */
export function stepCamera(step) {
  const all = cameras();
  select({ camera: all[(all.indexOf(state.camera) + step + all.length) % all.length] });
}
