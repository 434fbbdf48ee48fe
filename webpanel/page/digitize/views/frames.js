/**
 * Loads frames, lossless, and keeps the last ones. The one in sight comes first; those beside it are fetched in advance.
 *
 * @typedef {object} Frame
 * @property {CanvasImageSource} picture as it is to be drawn
 * @property {Uint32Array|null} counts how often each grey value is there; null: nobody asked
 */

import { asProblem } from "../../shared/api.js";
import { tellProblem } from "../../shared/snacks.js";
import { frameAddress } from "../session/server.js";
import { cameras, fate, indexOf, redraw, state } from "../session/state.js";
import { apply, histogram, isPlain, table } from "./tone.js";

/** So many frames are kept. */
const KEPT = 120;
/** So many are under way at once. */
const AT_ONCE = 4;
/** So many pulses are fetched in advance: while playing, and otherwise. */
const [AHEAD, BESIDE] = [8, 2];

/** Decoded frames by address, the one used last at the end. @type {Map<string, ImageBitmap>} */
const decoded = new Map();
/** @type {Set<string>} */
const underWay = new Set();
/** Addresses that gave no picture: they are not asked for again. @type {Set<string>} */
const broken = new Set();
/** Pictures with their tone, by camera. @type {Map<string, { key: string, canvas: OffscreenCanvas, counts: Uint32Array }>} */
const toned = new Map();

/**
 * The frame of a camera that is to be seen now; null: it is not there (yet).
 *
 * @param {string} camera
 * @param {boolean} [counted] whether its histogram is needed
 * @returns {Frame|null}
 */
export function frameOf(camera, counted = false) {
  if (fate(camera) !== "o") return null;
  const address = frameAddress(state.pulse, camera, state.difference);
  const bitmap = decoded.get(address);
  if (!bitmap) return null;
  decoded.delete(address);
  decoded.set(address, bitmap);
  if (isPlain(state.tone) && !counted) return { picture: bitmap, counts: null };
  const made = tone(camera, address, bitmap);
  return { picture: made.canvas, counts: made.counts };
}

/** Whether nothing more is to come of the pulse in sight. */
export function framesReady() {
  return wanted([0]).every((address) => decoded.has(address) || broken.has(address));
}

/** Fetch what is in sight and what will be; called whenever the page is drawn. */
export function fetchFrames() {
  const ahead = Array.from({ length: AHEAD + 1 }, (_, step) => step);
  const beside = Array.from({ length: BESIDE }, (_, step) => [step + 1, -step - 1]).flat();
  for (const address of wanted(state.playing ? ahead : [0, ...beside])) {
    if (underWay.size >= AT_ONCE) return;
    if (!decoded.has(address) && !underWay.has(address) && !broken.has(address)) void fetchOne(address);
  }
}

/** @param {number[]} steps pulses from the one in sight */
function wanted(steps) {
  const [pulses, at] = [state.opening?.pulses ?? [], indexOf(state.pulse)];
  const near = steps.map((step) => pulses[at + step]).filter((pulse) => pulse !== undefined);
  return near.flatMap((pulse) => cameras().filter((camera) => fate(camera, pulse) === "o")
    .map((camera) => frameAddress(pulse, camera, state.difference)));
}

/** @param {string} address */
async function fetchOne(address) {
  underWay.add(address);
  try {
    const answer = await fetch(address);
    if (!answer.ok) throw await asProblem(answer);
    // As it is in the file: no colour profile may change a grey value.
    const bitmap = await createImageBitmap(await answer.blob(), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    decoded.set(address, bitmap);
    for (const [old, eldest] of decoded) {
      if (decoded.size <= KEPT) break;
      eldest.close();
      decoded.delete(old);
    }
  } catch (error) {
    broken.add(address);
    if (!(error instanceof TypeError)) tellProblem(error); // without a connection the page says so elsewhere
    else setTimeout(() => { broken.delete(address); redraw(); }, 2000);
  } finally {
    underWay.delete(address);
    redraw();
  }
}

/**
 * @param {string} camera
 * @param {string} address
 * @param {ImageBitmap} bitmap
 */
function tone(camera, address, bitmap) {
  const key = `${address} ${JSON.stringify(state.tone)}`;
  const made = toned.get(camera);
  if (made?.key === key) return made;
  const canvas = made?.canvas.width === bitmap.width && made.canvas.height === bitmap.height ? made.canvas : new OffscreenCanvas(bitmap.width, bitmap.height);
  const context = /** @type {OffscreenCanvasRenderingContext2D} */ (canvas.getContext("2d", { willReadFrequently: true }));
  context.drawImage(bitmap, 0, 0);
  const image = context.getImageData(0, 0, bitmap.width, bitmap.height);
  const counts = histogram(image.data);
  if (!isPlain(state.tone)) {
    apply(image.data, table(state.tone));
    context.putImageData(image, 0, 0);
  }
  const now = { key, canvas, counts };
  toned.set(camera, now);
  return now;
}
