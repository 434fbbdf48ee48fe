/** What all parts that show the state of the rig need to know of it. */

import { known } from "./store.js";

/** Icon of each state. */
export const STATE_ICONS = { idle: "idle", arming: "arming", armed: "armed", recording: "recording", disarming: "arming", fault: "fault", unknown: "arming" };

/** Seconds recorded, counted on between two statuses so that the clock runs evenly. */
export function recordedFor() {
  return (known.status?.recording?.duration_s ?? 0) + Math.min(2, (Date.now() - known.heard) / 1000);
}
