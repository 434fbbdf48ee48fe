/** Live: what an operator looks at during a training. */

import { disarm, nextStep, saveLast, startActions } from "../live/actions.js";
import { startAutomatic } from "../live/automatic.js";
import { startHealth } from "../live/health.js";
import { drawMeasured, startMeasured } from "../live/measured.js";
import { showCamera, shownCamera, startPreview } from "../live/preview.js";
import { nextJumper, startSession } from "../live/session.js";
import { startStartList } from "../live/startlist.js";
import { startState } from "../live/state.js";
import { startLast } from "../recordings/last.js";
import { startLatest } from "../shared/latest.js";

export function start() {
  for (const begin of [startState, startSession, startStartList, startActions, startAutomatic, startPreview, startHealth, startMeasured, startLatest, startLast]) begin();
}

export const draw = drawMeasured;

/** @returns {import("./parts.js").Actions} */
export function keys() {
  return {
    "keys.next_step": nextStep,
    "keys.save_last": saveLast,
    "keys.next_jumper": nextJumper,
    "keys.disarm": disarm,
    "keys.camera": ({ key }) => camera(Number(key)),
    "keys.escape": () => showCamera(null),
  };
}

/** @param {number} digit 0: all */
function camera(digit) {
  const index = digit - 1;
  showCamera(digit === 0 || index === shownCamera() ? null : index);
}
