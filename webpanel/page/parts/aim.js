/** Sets up the cameras one by one: focus, light, balls in sight, calibration. */

import { startAim } from "../system/aim.js";
import { drawCalibrating } from "../system/calibrating.js";
import { drawEarlier, enterEarlier, startEarlier } from "../system/earlier.js";

export function start() {
  startAim();
  startEarlier();
}

export function draw() {
  drawEarlier();
  drawCalibrating();
}

export function enter() {
  void enterEarlier();
}
