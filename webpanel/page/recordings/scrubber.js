/** Steps through a recording triplet by triplet, with slider, keys, play button and strip. */

import { t } from "../i18n/i18n.js";
import { partOf } from "../shared/api.js";
import { $, make, setIcon, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { makeViewer } from "../shared/viewer.js";
import { makePan } from "./pan.js";
import { drawStrip, makeStrip } from "./strip.js";

/** @typedef {import("../shared/types.js").Pulses} Pulses */

/** @type {Pulses|null} */
let recording = null;
let at = 0;
/** @type {import("../shared/viewer.js").Viewer} */
let viewer;
/** @type {import("./pan.js").Pan} */
let pan;
let loading = false;
/** While playing: when that began, and its first pulse's time; null: not playing. @type {{ clock: number, time_s: number }|null} */
let playing = null;

export function startScrubber() {
  viewer = makeViewer($("frames"), chooseCamera);
  pan = makePan($("frames"), viewer.plane);
  makeStrip($("frame-strip"), showIndex);
  $("frame-slider").addEventListener("input", () => { pause(); showIndex(Number($("frame-slider").value)); });
  $("frame-back").addEventListener("click", () => step(-1));
  $("frame-on").addEventListener("click", () => step(1));
  $("frame-play").addEventListener("click", togglePlay);
  $("frame-gap").addEventListener("click", () => nextGap(1));
  $("zoom-in").addEventListener("click", () => pan.zoom(1.5));
  $("zoom-out").addEventListener("click", () => pan.zoom(1 / 1.5));
  viewer.image.addEventListener("load", loaded);
  viewer.image.addEventListener("error", () => { loading = false; });
}

/** Show nothing until the next `scrub`. */
export function clearScrubber() {
  pause();
  recording = null;
  loading = false;
  viewer.image.removeAttribute("src");
  viewer.image.alt = "";
  for (const words of ["frame-where", "frame-fate"]) setText($(words), "");
  $("frame-strip").hidden = true;
}

/**
 * Begin to step through a recording.
 *
 * @param {Pulses} pulses
 */
export function scrub(pulses) {
  recording = pulses;
  viewer.layOut(pulses.cameras.map((name, index) => ({ name, columns: pulses.columns[index] })), pulses.shape[0]);
  $("frame-slider").max = String(Math.max(0, pulses.pulses.length - 1));
  $("frame-strip").hidden = false;
  $("frame-gap").hidden = gaps().length === 0;
  makeCameraChoice(pulses.cameras);
  chooseCamera(null);
  drawStrip($("frame-strip"), pulses);
  showIndex(0);
}

/** Whether there are pulses to step through. */
export function canScrub() {
  return recording !== null && recording.pulses.length > 0;
}

/** @param {number} frames */
export function step(frames) {
  pause();
  showIndex(at + frames);
}

/** Go to the first pulse, or to the last. @param {boolean} last */
export function toEnd(last) {
  pause();
  showIndex(last ? (recording?.pulses.length ?? 1) - 1 : 0);
}

/** @param {1|-1} direction */
export function nextGap(direction) {
  pause();
  const all = direction > 0 ? gaps() : gaps().reverse();
  const next = all.find((index) => (index - at) * direction > 0) ?? all[0];
  if (next !== undefined) showIndex(next);
}

/** @param {number|null} index one camera large, or all */
export function chooseCamera(index) {
  viewer.select(index);
  pan.reset();
  [...$("frame-cameras").children].forEach((button, place) => {
    button.setAttribute("aria-pressed", String(place === (viewer.selected() ?? -1) + 1));
  });
}

export function togglePlay() {
  if (playing || !recording) return pause();
  const start = at >= recording.pulses.length - 1 ? 0 : at;
  playing = { clock: performance.now(), time_s: recording.pulses[start].time_s };
  drawPlay();
  showIndex(start);
  requestAnimationFrame(playOn);
}

/** Draw the words anew, in another language. */
export function drawWords() {
  if (recording) makeCameraChoice(recording.cameras);
  drawPlay();
  if (recording) drawPlace();
}

function pause() {
  playing = null;
  drawPlay();
}

/** Play on at the speed of the jump. Frames for which the connection is too slow are skipped. */
function playOn() {
  if (!playing || !recording) return;
  const now = playing.time_s + (performance.now() - playing.clock) / 1000;
  const { pulses } = recording;
  let next = at;
  while (next < pulses.length - 1 && pulses[next + 1].time_s <= now) next += 1;
  if (!loading && next !== at) showIndex(next);
  if (at >= pulses.length - 1) pause();
  else requestAnimationFrame(playOn);
}

/** @param {number} index */
function showIndex(index) {
  if (!recording || !recording.pulses.length) return;
  at = Math.min(Math.max(0, index), recording.pulses.length - 1);
  $("frame-slider").value = String(at);
  drawPlace();
  if (!loading) loadImage();
}

/** Load the image of the pulse. One image is loaded at a time; pulses passed meanwhile are never asked for. */
function loadImage() {
  if (!recording) return;
  const address = new URL(partOf(recording.id, `pulses/${recording.pulses[at].pulse}.jpg`), document.baseURI).href;
  if (viewer.image.src === address) return;
  loading = true;
  viewer.image.src = address;
}

function loaded() {
  loading = false;
  if (recording) loadImage();
}

function drawPlace() {
  if (!recording) return;
  const { pulse, time_s, statuses } = recording.pulses[at];
  const fates = recording.cameras.map((name, index) => `${name} ${t(`status.${statuses[index]}`)}`);
  setText($("frame-where"), t("scrub.where", { pulse, of: recording.pulses.length, time: number(time_s, 3) }));
  $("frame-slider").setAttribute("aria-valuetext", `${$("frame-where").textContent}, ${fates.join(", ")}`);
  setText($("frame-fate"), fates.join("  ·  "));
  $("frame-strip").style.setProperty("--at", String((at + 0.5) / recording.pulses.length));
  viewer.image.alt = t("scrub.alt", { pulse });
  statuses.forEach((status, index) => {
    const fine = status === "ok";
    viewer.cover(index, "warning", fine ? "" : t(`status.${status}`), fine ? "" : t(`status.${status}.means`), "");
  });
}

function drawPlay() {
  setIcon($("frame-play").querySelector("svg"), playing ? "pause" : "play");
  $("frame-play").setAttribute("aria-label", t(playing ? "scrub.pause" : "scrub.play"));
}

function gaps() {
  const pulses = recording?.pulses ?? [];
  return pulses.flatMap(({ statuses }, index) => (statuses.every((status) => status === "ok") ? [] : [index]));
}

/** @param {string[]} cameras */
function makeCameraChoice(cameras) {
  const shown = viewer.selected();
  $("frame-cameras").replaceChildren(...[t("scrub.all"), ...cameras].map((name, place) => make(
    "button", { type: "button", "aria-pressed": String(place === (shown ?? -1) + 1), onclick: () => chooseCamera(place ? place - 1 : null) }, name,
  )));
}
