/** Steps through a recording triplet by triplet, with slider, keys, play button and strip. */

import { t } from "../i18n/i18n.js";
import { partOf } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { makeViewer } from "../shared/viewer.js";
import { makePan } from "./pan.js";
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
let loading = false;
/** @type {import("./playing.js").Player} */
let player;

/** Index of the pulse at which the recording begins to matter. @type {number|null} */
let moment = null;
/** Called whenever another pulse or camera is in sight. @type {() => void} */
let whenShown = () => {};
/** Whether somebody has moved in the recording; then it stays where it is. */
let touched = false;

export function startScrubber() {
  viewer = makeViewer($("frames"), chooseCamera);
  pan = makePan($("frames"), viewer.plane);
  player = makePlayer({ pulses: () => recording?.pulses ?? [], at: () => at, moment: () => moment, ready: () => !loading, show: showIndex });
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
  viewer.image.addEventListener("load", loaded);
  viewer.image.addEventListener("error", () => { loading = false; });
}

/** Show nothing until the next `scrub`. */
export function clearScrubber() {
  player.pause();
  recording = null;
  moment = null;
  loading = touched = false;
  for (const button of ["frame-moment", "frame-gap"]) $(button).hidden = true; // until the pulses have come
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
  whenShown = action;
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

/** Go to a pulse. @param {number} pulse */
export function showPulse(pulse) {
  player.pause();
  const index = recording?.pulses.findIndex((each) => each.pulse === pulse) ?? -1;
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
  viewer.select(index);
  pan.reset();
  drawPng();
  whenShown();
  [...$("frame-cameras").children].forEach((button, place) => {
    button.setAttribute("aria-pressed", String(place === (viewer.selected() ?? -1) + 1));
  });
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
  if (recording) makeCameraChoice(recording.cameras);
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
  drawPng();
  whenShown();
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

/** @param {string[]} cameras */
function makeCameraChoice(cameras) {
  const shown = viewer.selected();
  $("frame-cameras").replaceChildren(...[t("scrub.all"), ...cameras].map((name, place) => make(
    "button", { type: "button", "aria-pressed": String(place === (shown ?? -1) + 1), onclick: () => chooseCamera(place ? place - 1 : null) }, name,
  )));
}
