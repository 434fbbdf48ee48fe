/**
 * Sounds and vibration for what an operator must notice while he watches the hill: a recording began, ended, a fault,
 * the last place on the disk, an alarm. And the wake lock, which keeps the display on while the rig is armed.
 *
 * Browsers allow sound only after the page was touched. All of it is off until it is switched on in the settings, on each
 * device, but for the sound of alarms, which is on until it is switched off: an alarm before the first touch sounds then.
 */

import { $ } from "../shared/dom.js";
import { known, load, save, watch } from "../shared/store.js";

/** @typedef {{ tones: [number, number][], pattern: number[] }} Signal tones: pitch in Hz (0: silence) and length in s; pattern: ms on, off, on … */

/** @type {Record<string, Signal>} */
const SIGNALS = {
  started: { tones: [[660, 0.12], [990, 0.18]], pattern: [200] },
  stopped: { tones: [[990, 0.12], [660, 0.18]], pattern: [100, 80, 100] },
  last_place: { tones: [[520, 0.15], [0, 0.1], [520, 0.15]], pattern: [300, 150, 300] },
  alarm: { tones: [[1175, 0.15], [0, 0.05], [1175, 0.15], [0, 0.05], [1175, 0.15], [880, 0.4]], pattern: [400, 100, 400, 100, 400] },
  warning: { tones: [[784, 0.2], [0, 0.1], [784, 0.2]], pattern: [300, 100, 300] },
  fault: { tones: [[880, 0.2], [440, 0.2], [880, 0.2], [440, 0.4]], pattern: [500, 150, 500, 150, 500] },
};
const LOUDNESS = 0.4;
/** A tone begins and ends within this time, so that it does not click, s. */
const RAMP_S = 0.01;

/** @type {AudioContext|null} */
let audio = null;
/** What the last status was; null: none has come, so that nothing is signalled for what was so before. @type {{ recording: boolean, fault: boolean, last: boolean }|null} */
let before = null;
/** @type {WakeLockSentinel|null} */
let lock = null;
let locking = false;
/** Whether the page was touched: before that a browser makes no sound, and complains if it is asked. */
let touched = false;

export function startSignals() {
  for (const name of ["sound", "vibration", "awake"]) {
    const box = $(`signal-${name}`);
    box.checked = load(name, false);
    box.addEventListener("change", () => {
      save(name, box.checked);
      if (box.checked && name !== "awake") give("started"); // to hear, or feel, that it works
      void keepAwake();
    });
  }
  $("signal-alarms").checked = load("alarms", true);
  $("signal-alarms").addEventListener("change", () => setAlarmSound($("signal-alarms").checked));
  $("signal-vibration").closest("label").hidden = !("vibrate" in navigator);
  $("signal-awake").closest("label").hidden = !("wakeLock" in navigator); // needs HTTPS, or the computer itself
  for (const touch of ["pointerdown", "keydown"]) addEventListener(touch, () => void wake());
  watch(notice);
  watch(callForSomebody);
  watch(() => void keepAwake());
}

/** Whether alarms sound on this device. */
export function soundsAlarms() {
  return $("signal-alarms").checked;
}

/**
 * Let alarms sound on this device, or not; it is remembered.
 *
 * @param {boolean} on
 */
export function setAlarmSound(on) {
  $("signal-alarms").checked = on;
  save("alarms", on);
  if (on) give("warning", true); // to hear that it works
}

/** At a touch: be ready for sounds, and give that of an alarm which came before. */
async function wake() {
  touched = true;
  if (!wants("sound") && !soundsAlarms()) return;
  await sounding().resume();
  callForSomebody();
}

/** Give the sound of alarms that this browser has not heard yet, once for all of them. */
function callForSomebody() {
  const { status, connected } = known;
  if (!status || !connected) return;
  const heard = load("alarms_heard", 0);
  const fresh = status.alarms.filter(({ since, acknowledged }) => !acknowledged && Date.parse(since) > heard);
  if (!fresh.length || soundsAlarms() && !touched) return;
  save("alarms_heard", Math.max(...fresh.map(({ since }) => Date.parse(since))));
  give(fresh.some(({ statement }) => statement.level === "error") ? "alarm" : "warning", soundsAlarms());
}

/** @param {"sound"|"vibration"|"awake"} name */
function wants(name) {
  return $(`signal-${name}`).checked;
}

function sounding() {
  audio ??= new AudioContext();
  return audio;
}

function notice() {
  const { status, connected } = known;
  if (!status || !connected) return;
  const now = { recording: status.state === "recording", fault: status.state === "fault", last: status.disk.jumps_left <= 1 };
  if (before) {
    if (now.fault && !before.fault) give("fault");
    else if (now.recording && !before.recording) give("started");
    else if (!now.recording && before.recording) give("stopped");
    if (now.last && !before.last) give("last_place");
  }
  before = now;
}

/**
 * @param {string} name
 * @param {boolean} [audible]
 */
function give(name, audible = wants("sound")) {
  const { tones, pattern } = SIGNALS[name];
  if (wants("vibration")) navigator.vibrate(pattern);
  if (!audible) return;
  const context = sounding();
  let at = context.currentTime + RAMP_S;
  for (const [pitch, length] of tones) {
    if (pitch) play(context, pitch, at, length);
    at += length;
  }
}

/**
 * @param {AudioContext} context
 * @param {number} pitch
 * @param {number} at
 * @param {number} length
 */
function play(context, pitch, at, length) {
  const tone = new OscillatorNode(context, { type: "triangle", frequency: pitch });
  const loudness = new GainNode(context, { gain: 0 });
  loudness.gain.setTargetAtTime(LOUDNESS, at, RAMP_S);
  loudness.gain.setTargetAtTime(0, at + length - 3 * RAMP_S, RAMP_S);
  tone.connect(loudness).connect(context.destination);
  tone.start(at);
  tone.stop(at + length);
}

/**
 * Keep the display on while the page is visible: the coach's screen always, others while the rig is armed, if that is wished.
 * The browser lets go when the page is hidden.
 */
async function keepAwake() {
  const needed = known.view === "coach" || wants("awake") && ["armed", "recording"].includes(known.status?.state ?? "");
  const wanted = needed && known.visible && "wakeLock" in navigator;
  if (locking || wanted === Boolean(lock && !lock.released)) return;
  locking = true;
  try {
    if (wanted) lock = await navigator.wakeLock.request("screen");
    else await lock?.release();
  } catch (error) {
    if (!(error instanceof DOMException)) throw error; // the battery is low: the device decides
    $("signal-awake").checked = false;
  } finally {
    locking = false;
  }
}
