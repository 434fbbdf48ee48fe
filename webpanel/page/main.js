/** Puts the page together. Each part draws itself from what store.js holds; connection.js keeps that up to date. */

import { drawAthlete, enterAthlete, startAthlete } from "./athletes/athlete.js";
import { drawDay, enterDay, startDay } from "./athletes/day.js";
import { startAlarms } from "./frame/alarms.js";
import { drawKeys, startKeys } from "./frame/keys.js";
import { startLogin } from "./frame/login.js";
import { startRole } from "./frame/role.js";
import { startSettings } from "./frame/settings.js";
import { startSignals } from "./frame/signals.js";
import { startLanguage } from "./i18n/i18n.js";
import { drawShare, enterShare, startShare } from "./jump/code.js";
import { drawCoach, startCoach } from "./jump/coach.js";
import { drawVisit, enterVisit, leaveVisit, startVisit } from "./jump/visit.js";
import { startActions } from "./live/actions.js";
import { startAutomatic } from "./live/automatic.js";
import { startHealth } from "./live/health.js";
import { drawMeasured, startMeasured } from "./live/measured.js";
import { startPreview } from "./live/preview.js";
import { startSession } from "./live/session.js";
import { startStartList } from "./live/startlist.js";
import { startState } from "./live/state.js";
import { drawExports, startExports } from "./recordings/exports.js";
import { startKinogram } from "./recordings/kinogram.js";
import { startLast } from "./recordings/last.js";
import { drawJump } from "./recordings/jump.js";
import { startMeasurement } from "./recordings/measurement.js";
import * as recording from "./recordings/recording.js";
import * as recordings from "./recordings/recordings.js";
import { connect, startBanner } from "./shared/connection.js";
import { startLatest } from "./shared/latest.js";
import { place, startRouter } from "./shared/router.js";
import { update } from "./shared/store.js";
import { startAim } from "./system/aim.js";
import { drawCalibrating } from "./system/calibrating.js";
import * as doctor from "./system/doctor.js";
import { drawEarlier, enterEarlier, startEarlier } from "./system/earlier.js";
import { startLog } from "./system/log.js";
import { drawPulses, enterPulses, startPulses } from "./system/pulses.js";
import { drawRegion, enterRegion, startRegion } from "./system/region.js";
import * as rehearsal from "./system/rehearsal.js";
import * as rig from "./system/rig.js";
import { drawChoices, startComparing } from "./viewing/comparing.js";
import { drawCurves, startCurves } from "./viewing/curves.js";
import { drawJumps } from "./viewing/jumps.js";
import { drawNotes, startNotes } from "./viewing/notes.js";
import * as scrubber from "./viewing/scrubber.js";
import { startStick } from "./viewing/stick.js";
import { drawVoices, startVoice } from "./viewing/voice.js";

/** Draw every part anew, after the language was changed. */
function redraw() {
  update({});
  for (const part of [recordings, recording, doctor, rehearsal, rig]) part.draw();
  scrubber.drawWords();
  drawNotes();
  drawVoices();
  drawChoices();
  drawExports();
  drawJump();
  drawCurves();
  drawJumps();
  drawEarlier();
  drawCalibrating();
  drawKeys();
  drawPulses();
  drawAthlete();
  drawDay();
  drawRegion();
  drawMeasured();
  drawShare();
  drawCoach();
  if (place().view === "jump") drawVisit();
}

let connected = false;

/** @param {import("./shared/router.js").Place} place */
function entered({ view, id, key }) {
  scrubber.clearScrubber();
  leaveVisit();
  enterShare(view === "recording" ? id : "");
  if (view === "jump") void enterVisit(id, key);
  else if (!connected) { // a link opens its jump, and not what happens at the hill
    connected = true;
    connect();
  }
  if (view === "recordings") recordings.enterRecordings();
  if (view === "recording") void recording.enterRecording(id);
  if (view === "athlete") void enterAthlete();
  if (view === "jumps") void enterDay();
  if (view === "doctor") {
    doctor.draw();
    rehearsal.enterRehearsal();
    void enterPulses();
    void enterRegion();
  }
  if (view === "aim") void enterEarlier();
  if (view === "rig") void rig.enterRig();
}

startSettings(redraw);
startLanguage();
for (const start of [startState, startSession, startStartList, startActions, startAutomatic, startPreview, startHealth, startMeasured, startBanner, startLog, startLatest]) start();
for (const start of [doctor.startDoctor, rehearsal.startRehearsal, startPulses, startRegion, startAim, startEarlier, recordings.startRecordings, startLast, scrubber.startScrubber, startComparing, startNotes, startVoice, startExports, startMeasurement, startKinogram, startStick, startCurves, startShare, startCoach, startVisit]) start();
for (const start of [recording.startRecording, startAthlete, startDay, rig.startRig, startKeys]) start();
startRole();
startSignals();
startAlarms();
startLogin(() => location.reload());
startRouter(entered, recordings.leaveRecordings);
document.addEventListener("visibilitychange", () => update({ visible: !document.hidden }));
