/** What a place in one image means for the others: asked for while the pointer moves, one question under way at a time. */

import { Problem } from "../../shared/api.js";
import { said } from "../session/advance.js";
import { getGeometry } from "../session/server.js";
import { cameras, change, state, watch } from "../session/state.js";

/** @typedef {import("../types.js").Place} Place */

/** The place asked for next; the ones in between are never asked for. @type {{ camera: string, thing: string, xy: Place }|null} */
let wanted = null;
let underWay = false;
/** Of which marks the curves were asked for. */
let asked = "";

/** Keep the curves of what is marked up to date. */
export function startGeometry() {
  watch(() => void followMarks());
}

/** Whether anything can be computed in space. */
function oriented() {
  return state.opening?.cameras.some((camera) => camera.oriented) ?? false;
}

/**
 * Ask for what a place means; the answer becomes `state.live`.
 *
 * @param {string} camera
 * @param {string} thing
 * @param {Place} xy
 */
export function follow(camera, thing, xy) {
  if (!state.operator || !thing || !oriented()) return;
  wanted = { camera, thing, xy };
  if (!underWay) void ask();
}

/** The pointer has left: nothing is live any more. */
export function unfollow() {
  wanted = null;
  if (state.live) change({ live: null });
}

async function ask() {
  underWay = true;
  try {
    while (wanted) {
      const { camera, thing, xy } = wanted;
      const { pulse, operator } = state;
      wanted = null;
      const geometry = await getGeometry(operator, { pulse, camera, thing }, xy);
      if (pulse === state.pulse && (state.hover || state.dragged)) change({ live: { camera, geometry } });
    }
  } catch (error) {
    // A place from which nothing follows, or no connection: what was drawn is old. The page says elsewhere what is wrong.
    if (!(error instanceof Problem)) throw error;
    change({ live: null });
  } finally {
    underWay = false;
  }
}

/** Ask for the curves of the marks of the selected thing: where it must be in the other views. */
async function followMarks() {
  const { view, pulse, thing, operator } = state;
  const marks = cameras().map((camera) => said(view, camera, thing)?.marks.findLast(({ xy }) => xy)).filter((mark) => mark !== undefined);
  const now = JSON.stringify([operator, pulse, thing, view?.revision, marks.map(({ camera, xy }) => [camera, xy])]);
  if (now === asked || !view || !oriented()) return;
  asked = now;
  /** @type {typeof state.curves} */
  const curves = {};
  try {
    for (const { camera, xy } of marks) {
      if (xy) curves[camera] = (await getGeometry(operator, { pulse, camera, thing }, xy)).curves;
    }
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
  }
  if (now === asked) change({ curves });
}
