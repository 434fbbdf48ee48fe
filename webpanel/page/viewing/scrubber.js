/** Steps through a recording triplet by triplet, with slider, keys, play button and strip. */

import { t } from "../i18n/i18n.js";
import { partOf } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { makeViewer } from "../shared/viewer.js";
import { makeChoice } from "./choice.js";
import { makePan } from "./pan.js";
import { makePicture } from "./picture.js";
import { makePlayer } from "./playing.js";
import { drawStrip, makeStrip } from "./strip.js";

/** @typedef {import("../shared/types.js").Pulses} Pulses */

/** @type {Pulses|null} */
let recording = null;
let at = 0;
/** @type {import("../shared/viewer.js").Viewer} */
let viewer;
/** @type {import("./pan.js").Pan} */
let pan;
/** @type {import("./choice.js").Choice} */
let choice;
/** @type {import("./picture.js").Picture} */
let picture;
/** @type {import("./playing.js").Player} */
let player;

/** Index of the pulse at which the recording begins to matter. @type {number|null} */
let moment = null;
/** Called whenever another pulse or camera is in sight. @type {(() => void)[]} */
const whenShown = [];
/** Called whenever another picture is shown. @type {(() => void)[]} */
const whenPictured = [];
/** Whether somebody has moved in the recording; then it stays where it is. */
let touched = false;

export function startScrubber() {
  viewer = makeViewer($("frames"), chooseCamera);
  pan = makePan($("frames"), viewer.plane);
  choice = makeChoice(viewer, $("frames"), () => { pan.reset(); drawPng(); tellAll(whenShown); });
  picture = makePicture(viewer.image, () => (recording?.pulses[at] ? { id: recording.id, pulse: recording.pulses[at].pulse } : null), () => tellAll(whenPictured));
  player = makePlayer({ pulses: () => recording?.pulses ?? [], at: () => at, moment: () => moment, ready: picture.ready, show: showIndex });
  makeStrip($("frame-strip"), (index) => { touched = true; showIndex(index); });
  $("frame-slider").addEventListener("input", () => { touched = true; player.pause(); showIndex(Number($("frame-slider").value)); });
  $("frame-back").addEventListener("click", () => step(-1));
  $("frame-on").addEventListener("click", () => step(1));
  $("frame-play").addEventListener("click", togglePlay);
  $("frame-gap").addEventListener("click", () => nextGap(1));
  $("frame-loop").addEventListener("click", player.toggleLoop);
  $("frame-moment").addEventListener("click", toMoment);
  player.draw();
  $("zoom-in").addEventListener("click", () => pan.zoom(1.5));
  $("zoom-out").addEventListener("click", () => pan.zoom(1 / 1.5));
}

/** Show nothing until the next `scrub`. */
export function clearScrubber() {
  player.pause();
  recording = null;
  moment = null;
  touched = false;
  for (const button of ["frame-moment", "frame-gap"]) $(button).hidden = true; // until the pulses have come
  picture.clear();
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
  viewer.layOut(blocksOf(pulses), pulses.shape[0]);
  $("frame-slider").max = String(Math.max(0, pulses.pulses.length - 1));
  $("frame-strip").hidden = false;
  $("frame-gap").hidden = gaps().length === 0;
  choice.offer(pulses.cameras);
  drawStrip($("frame-strip"), pulses);
  showIndex(0);
}

/**
 * Tell which pulse matters, and go there unless somebody has moved already.
 *
 * @param {number|null} pulse
 * @param {string} kind how it was found
 */
export function setMoment(pulse, kind) {
  const index = recording?.pulses.findIndex((each) => each.pulse === pulse) ?? -1;
  moment = index < 0 ? null : index;
  $("frame-moment").hidden = moment === null;
  $("frame-moment").dataset.kind = kind;
  drawMoment();
  if (moment !== null && !touched) showIndex(moment);
}

/** Go to the pulse that matters. */
export function toMoment() {
  player.pause();
  if (moment !== null) showIndex(moment);
}

/** @param {() => void} action called whenever another pulse or camera is in sight */
export function onShown(action) {
  whenShown.push(action);
}

/** @param {() => void} action called whenever another picture is shown */
export function onPictured(action) {
  whenPictured.push(action);
}

/** The picture that is shown: where to draw over it, its pulse (null: none is shown), its cameras and rows. */
export function pictured() {
  return { over: viewer.over, pulse: picture.pulse(), blocks: recording ? blocksOf(recording) : [], rows: recording?.shape[0] ?? 1 };
}

/** How long after the pulse that matters the one in sight is, and which camera is large. */
export function sinceMoment() {
  const pulses = recording?.pulses ?? [];
  return { since_s: (pulses[at]?.time_s ?? 0) - (pulses[moment ?? 0]?.time_s ?? 0), camera: viewer.selected() };
}

/** The pulse in sight; null: there is none. */
export function pulseShown() {
  return recording?.pulses[at]?.pulse ?? null;
}

/** Go to a pulse, or to the next one if the recording lacks it. @param {number} pulse */
export function showPulse(pulse) {
  touched = true;
  player.pause();
  const index = recording?.pulses.findIndex((each) => each.pulse >= pulse) ?? -1;
  if (index >= 0) showIndex(index);
}

/** Whether there are pulses to step through. */
export function canScrub() {
  return recording !== null && recording.pulses.length > 0;
}

/** @param {number} frames */
export function step(frames) {
  touched = true;
  player.pause();
  showIndex(at + frames);
}

/** Go to the first pulse, or to the last. @param {boolean} last */
export function toEnd(last) {
  touched = true;
  player.pause();
  showIndex(last ? (recording?.pulses.length ?? 1) - 1 : 0);
}

/** @param {1|-1} direction */
export function nextGap(direction) {
  touched = true;
  player.pause();
  const all = direction > 0 ? gaps() : gaps().reverse();
  const next = all.find((index) => (index - at) * direction > 0) ?? all[0];
  if (next !== undefined) showIndex(next);
}

/** @param {number|null} index one camera large, or all */
export function chooseCamera(index) {
  choice.choose(index);
}

export function togglePlay() {
  touched = true;
  player.toggle();
}

/** The player, for keys. */
export function playerInUse() {
  return player;
}

/** Draw the words anew, in another language. */
export function drawWords() {
  if (recording) choice.draw();
  drawMoment();
  player.draw();
  if (recording) drawPlace();
}

/** @param {number} index */
function showIndex(index) {
  if (!recording || !recording.pulses.length) return;
  at = Math.min(Math.max(0, index), recording.pulses.length - 1);
  $("frame-slider").value = String(at);
  drawPlace();
  picture.load();
}

/** @param {Pulses} pulses */
function blocksOf({ cameras, columns }) {
  return cameras.map((name, index) => ({ name, columns: columns[index] }));
}

/** @param {(() => void)[]} listeners */
function tellAll(listeners) {
  for (const tell of listeners) tell();
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
  drawPng();
  tellAll(whenShown);
  statuses.forEach((status, index) => {
    const fine = status === "ok";
    viewer.cover(index, "warning", fine ? "" : t(`status.${status}`), fine ? "" : t(`status.${status}.means`), "");
  });
}

/** The link to the picture in sight, without loss. */
function drawPng() {
  if (!recording) return;
  const one = viewer.selected();
  const camera = one === null ? "" : `&camera=${encodeURIComponent(recording.cameras[one])}`;
  $("frame-png").href = partOf(recording.id, `pulses/${recording.pulses[at]?.pulse ?? 1}.png?download=true${camera}`);
}

function drawMoment() {
  const takeoff = $("frame-moment").dataset.kind === "takeoff";
  setText($("frame-moment").querySelector("span"), t(takeoff ? "scrub.takeoff" : "scrub.busiest"));
}

function gaps() {
  const pulses = recording?.pulses ?? [];
  return pulses.flatMap(({ statuses }, index) => (statuses.every((status) => status === "ok") ? [] : [index]));
}
