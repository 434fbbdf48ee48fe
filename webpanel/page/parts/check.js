/** Checks of the rig: doctor, pulses of our own, regions, parts of recordings, rehearsal. */

import * as doctor from "../system/doctor.js";
import { drawParts, enterParts, startParts } from "../system/parts.js";
import { drawPulses, enterPulses, startPulses } from "../system/pulses.js";
import { drawRegion, enterRegion, startRegion } from "../system/region.js";
import * as rehearsal from "../system/rehearsal.js";

export function start() {
  for (const begin of [doctor.startDoctor, rehearsal.startRehearsal, startPulses, startRegion, startParts]) begin();
}

export function draw() {
  for (const again of [doctor.draw, rehearsal.draw, drawPulses, drawRegion, drawParts]) again();
}

export function enter() {
  doctor.draw();
  rehearsal.enterRehearsal();
  void enterPulses();
  void enterRegion();
  void enterParts();
}
