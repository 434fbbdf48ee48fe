/** One jump, for the athlete who has scanned its code. */

import { drawVisit, enterVisit, leaveVisit, startVisit } from "../jump/visit.js";
import { known } from "../shared/store.js";

export { leaveVisit as leave, startVisit as start };

export function draw() {
  if (known.view === "jump") drawVisit();
}

/** @param {import("../shared/router.js").Place} place */
export function enter({ id, key }) {
  void enterVisit(id, key);
}
