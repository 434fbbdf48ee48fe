/** Puts the page together. Each part draws itself; what they know stands in store.js, and events.js brings the news. */

import { startActions } from "./actions.js";
import { call, Problem } from "./api.js";
import { startBanner } from "./banner.js";
import { startCameras } from "./cameras.js";
import * as doctor from "./doctor.js";
import { connect, connectNow } from "./events.js";
import { startLanguage } from "./i18n.js";
import { startKeys } from "./keys.js";
import { startLog } from "./log.js";
import { startLogin } from "./login.js";
import { startLook } from "./look.js";
import { startPreview } from "./preview.js";
import * as recording from "./recording.js";
import * as recordings from "./recordings.js";
import * as rig from "./rig.js";
import { startRouter } from "./router.js";
import * as scrubber from "./scrubber.js";
import { startSession } from "./session.js";
import { startSettings } from "./settings.js";
import { startState } from "./state.js";
import { update } from "./store.js";
import { startVitals } from "./vitals.js";

/** Draw everything anew, in the language that is in use now. */
function redraw() {
  update({});
  for (const part of [recordings, recording, doctor, rig]) part.draw();
  scrubber.drawWords();
}

/** @param {import("./router.js").Place} place */
function entered({ view, id }) {
  scrubber.clearScrubber();
  if (view === "recordings") recordings.enterRecordings();
  if (view === "recording") void recording.enterRecording(id);
  if (view === "doctor") doctor.draw();
  if (view === "rig") void rig.enterRig();
}

/** Ask once before the stream is opened: the service may want the token. */
async function begin() {
  try {
    await call("GET", "status");
    connect();
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (error.status !== 401) connectNow();
  }
}

startLook();
startLanguage();
for (const start of [startState, startSession, startActions, startPreview, startCameras, startVitals, startBanner, startLog]) start();
for (const start of [doctor.startDoctor, recordings.startRecordings, scrubber.startScrubber, recording.startRecording, startKeys]) start();
startSettings(redraw);
startLogin(() => location.reload());
startRouter(entered);
document.addEventListener("visibilitychange", () => update({ visible: !document.hidden }));
void begin();

