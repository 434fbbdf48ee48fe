/** All calls of this page: where they go, and what they give. */

import { call, partOf, recordingPath } from "../../shared/api.js";

/**
 * @typedef {import("../types.js").Place} Place
 * @typedef {import("../types.js").PulseView} PulseView
 *
 * @typedef {{ pulse: number, camera: string, thing: string }} Spot
 * @typedef {Spot & { do: "place", xy: Place, vertex: number|null, state: "measured"|"guess",
 *   source: "hand"|"refined"|"automatic", sigma: [number, number]|null }} PlaceAction
 * @typedef {Spot & { do: "state", state: "hidden"|"not visible" }} StateAction
 * @typedef {Spot & { do: "remove", vertex: number|null }} RemoveAction
 * @typedef {PlaceAction|StateAction|RemoveAction|{ do: "undo" }|{ do: "redo" }} Action
 */

/** A change is waited for so long, ms: longer than the service waits. */
const WAIT_MS = 40_000;
/** Following a thing through many pulses, orienting and reading files takes its time, ms. */
const LONG_MS = 180_000;

/** The recording that this page is of: `?recording=` of its address. */
export const recording = new URLSearchParams(location.search).get("recording") ?? "";

/** @param {string} part of the path */
function path(part) {
  return recordingPath(recording, `/digitizing${part}`);
}

/**
 * @param {string} operator
 * @param {string} [part]
 */
function session(operator, part = "") {
  return `/sessions/${encodeURIComponent(operator)}${part}`;
}

/** @returns {Promise<{ role: string }>} what this browser may do */
export const getAccess = () => call("GET", "access");

/** @returns {Promise<import("../types.js").Opening>} */
export const getOpening = () => call("GET", path(""), undefined, LONG_MS);

/**
 * Orient the cameras by the balls that an operator clicked.
 *
 * @param {string} operator "": by those that the images show
 * @returns {Promise<import("../types.js").OrientationState>}
 */
export const orient = (operator) => call("POST", path(`/orientation${operator ? `?${new URLSearchParams({ operator })}` : ""}`), undefined, LONG_MS);

/**
 * @param {number} pulse
 * @param {string} camera
 * @param {boolean} difference to the background
 * @returns {string} address of a picture
 */
export function frameAddress(pulse, camera, difference) {
  return partOf(recording, `digitizing/frames/${pulse}/${encodeURIComponent(camera)}.png${difference ? "?difference=true" : ""}`);
}

/** @param {string} operator @returns {Promise<import("../types.js").SessionView>} */
export const getSession = (operator) => call("GET", path(session(operator)));

/** @param {string} operator @param {number} pulse @returns {Promise<PulseView>} */
export const getPulse = (operator, pulse) => call("GET", path(session(operator, `/pulses/${pulse}`)));

/** @param {string} operator @param {Action} action @returns {Promise<import("../types.js").Changed>} */
export const act = (operator, action) => call("POST", path(session(operator, "/actions")), action);

/** @param {string} operator @param {number} since @returns {Promise<import("../types.js").Changes>} */
export const getChanges = (operator, since) => call("GET", path(session(operator, `/changes?since=${since}`)), undefined, WAIT_MS);

/**
 * What a place in one image means for the others.
 *
 * @param {string} operator
 * @param {Spot} spot
 * @param {Place} place
 * @returns {Promise<import("../types.js").Geometry>}
 */
export function getGeometry(operator, { pulse, camera, thing }, [x, y]) {
  const query = new URLSearchParams({ operator, pulse: String(pulse), camera, thing, x: String(x), y: String(y) });
  return call("GET", path(`/geometry?${query}`));
}

/**
 * @param {{ pulse: number, camera: string, x: number, y: number, end?: Place, kind: "disc"|"dark disc"|"edge"|"line" }} order
 * @returns {Promise<import("../types.js").Refined>}
 */
export const refine = (order) => call("POST", path("/refine"), order);

/**
 * @param {string} operator
 * @param {{ things: string[], pulse: number, direction: 1|-1, most: number }} order
 * @returns {Promise<import("../types.js").Tracking>}
 */
export const track = (operator, order) => call("POST", path(session(operator, "/track")), order);

/** @param {string} operator @returns {Promise<import("../types.js").Tracking>} */
export const getTracking = (operator) => call("GET", path(session(operator, "/track")));

/** @param {string} operator @returns {Promise<import("../types.js").Tracking>} */
export const cancelTracking = (operator) => call("DELETE", path(session(operator, "/track")));

/** @param {string} operator @returns {Promise<import("../types.js").Suggestion|null>} */
export const getNext = (operator) => call("GET", path(session(operator, "/next")));

/**
 * A length between two things.
 *
 * @param {{ pulse: number, from: Record<string, Place>, to: Record<string, Place> }} order
 * @returns {Promise<import("../types.js").Estimate>}
 */
export const measureTape = (order) => call("POST", path("/tape"), order);

/** @param {string} operator @returns {Promise<import("../types.js").HandCurves>} the newest that are known; newer ones begin */
export const getCurves = (operator) => call("GET", path(session(operator, "/curves")));

/** @param {string} operator @returns {Promise<import("../types.js").HandResult>} */
export const compute = (operator) => call("POST", path(session(operator, "/compute")));

/** @param {string} operator @returns {Promise<import("../types.js").HandResult>} */
export const cancelComputing = (operator) => call("DELETE", path(session(operator, "/compute")));

/** @param {string} operator @returns {Promise<import("../types.js").HandResult>} */
export const getResult = (operator) => call("GET", path(session(operator, "/result")));

/** @param {string} operator @param {string} name @returns {string} address of a file of the result */
export function resultFile(operator, name) {
  return partOf(recording, `digitizing${session(operator, `/result/files/${encodeURIComponent(name)}`)}`);
}

/** @param {string} operator @param {string} name @returns {string} address of what was measured, as a file */
export function exportAddress(operator, name) {
  return partOf(recording, `digitizing${session(operator, `/export/${name}`)}`);
}

/** @param {string} operator @param {Blob} file */
export const importFile = (operator, file) => call("POST", path(session(operator, "/import")), file, LONG_MS);

/** @param {string[]} operators @returns {Promise<import("../types.js").Repeatability>} */
export function getRepeatability(operators) {
  return call("GET", path(`/repeatability?${new URLSearchParams({ operators: operators.join(",") })}`), undefined, LONG_MS);
}
