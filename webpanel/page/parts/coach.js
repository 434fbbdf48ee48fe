/** The coach's screen. */

import { drawCoach, startCoach } from "../jump/coach.js";
import { startLatest } from "../shared/latest.js";

export function start() {
  startLatest();
  startCoach();
}

export { drawCoach as draw };
