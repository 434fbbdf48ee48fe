/** One recording: its triplets, what was measured in it, what can be made of it. */

import { drawShare, enterShare, startShare } from "../jump/code.js";
import { drawExports, startExports } from "../recordings/exports.js";
import { drawJump } from "../recordings/jump.js";
import { startKinogram } from "../recordings/kinogram.js";
import { startMeasurement } from "../recordings/measurement.js";
import * as recording from "../recordings/recording.js";
import { go } from "../shared/router.js";
import { known } from "../shared/store.js";
import { drawChoices, startComparing } from "../viewing/comparing.js";
import { drawCurves, startCurves } from "../viewing/curves.js";
import { drawJumps } from "../viewing/jumps.js";
import { beginNote, drawNotes, startNotes } from "../viewing/notes.js";
import * as scrubber from "../viewing/scrubber.js";
import { startStick } from "../viewing/stick.js";
import { drawVoices, startVoice } from "../viewing/voice.js";

/** So many pulses are one step with Shift. */
const STEP = 10;

export function start() {
  for (const begin of [scrubber.startScrubber, startComparing, startNotes, startVoice, startExports, startMeasurement, startKinogram, startStick, startCurves, startShare, recording.startRecording]) begin();
}

export function draw() {
  for (const again of [recording.draw, scrubber.drawWords, drawNotes, drawVoices, drawChoices, drawExports, drawJump, drawCurves, drawJumps, drawShare]) again();
}

/** @param {import("../shared/router.js").Place} place */
export function enter({ id }) {
  enterShare(id);
  void recording.enterRecording(id);
}

export function leave() {
  scrubber.clearScrubber();
  enterShare("");
}

/** @returns {import("./parts.js").Actions} */
export function keys() {
  /** @type {import("./parts.js").Actions} */
  const always = {
    "keys.delete": () => { if (known.role === "administer") void recording.deleteShown(); },
    "keys.escape": () => go("recordings"),
  };
  if (!scrubber.canScrub()) return always;
  return {
    ...always,
    "keys.frame": ({ key, shiftKey }) => scrubber.step((key === "ArrowLeft" ? -1 : 1) * (shiftKey ? STEP : 1)),
    "keys.ends": ({ key }) => scrubber.toEnd(key === "End"),
    "keys.play": scrubber.togglePlay,
    "keys.gap": () => scrubber.nextGap(1),
    "keys.moment": scrubber.toMoment,
    "keys.loop": () => scrubber.playerInUse().toggleLoop(),
    "keys.speed": ({ key }) => scrubber.playerInUse().changeSpeed(key === "-" ? 1 : -1),
    "keys.note": beginNote,
    "keys.camera": ({ key }) => scrubber.chooseCamera(Number(key) ? Number(key) - 1 : null),
  };
}
