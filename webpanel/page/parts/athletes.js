/** Measured jumps: of an athlete over the days, and of a day in a table. */

import { drawAthlete, enterAthlete, startAthlete } from "../athletes/athlete.js";
import { drawDay, enterDay, startDay } from "../athletes/day.js";

export function start() {
  startAthlete();
  startDay();
}

export function draw() {
  drawAthlete();
  drawDay();
}

/** @param {import("../shared/router.js").Place} place */
export function enter({ view }) {
  void (view === "athlete" ? enterAthlete() : enterDay());
}
