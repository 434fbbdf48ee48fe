/**
 * Puts the page of measuring by hand together: `digitize.html?recording=ID`.
 *
 * Its rooms, each of which sees those before it: `session` (what is known and kept, by whom), `marking` (how a click becomes
 * a mark, and what it means), `views` (the pictures and what is drawn over them), `cards` (what stands beside them).
 */

import { startLogin } from "../frame/login.js";
import { say, startLanguage, t } from "../i18n/i18n.js";
import { Problem } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { update } from "../shared/store.js";
import { drawCurves, startCurves } from "./cards/curves.js";
import { startFiles } from "./cards/files.js";
import { startNumbers } from "./cards/numbers.js";
import { startOrientation } from "./cards/orientation.js";
import { drawSpeeds, startPulses } from "./cards/pulses.js";
import { drawResult, startResults } from "./cards/results.js";
import { startThings } from "./cards/things.js";
import { drawTracking, refineHere, startTracking } from "./cards/tracking.js";
import { startKeys } from "./keys.js";
import { startGeometry } from "./marking/geometry.js";
import { accept } from "./marking/marking.js";
import { startTape } from "./marking/tape.js";
import { startOperator } from "./session/operator.js";
import { getAccess, getOpening, recording } from "./session/server.js";
import { takeBack } from "./session/session.js";
import { cameras, change, redraw, state, watch } from "./session/state.js";
import { startPanes } from "./views/panes.js";
import { startPicture } from "./views/picture.js";

await startLanguage("digitize", "recording", "measuring");
startLogin(() => location.reload());
void begin();

async function begin() {
  try {
    await open();
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    setText($("opening"), say({ code: error.code, text: error.message }).text);
  }
}

async function open() {
  const [{ role }, opening] = await Promise.all([getAccess(), getOpening()]);
  update({ role });
  document.body.dataset.role = role; // hides what it does not allow
  document.title = t("digitize.title_of", { recording });
  setText($("recording"), opening.recording);
  change({
    opening,
    pulse: opening.jump?.takeoff ?? opening.jump?.first ?? opening.pulses[0],
    camera: opening.cameras[0].name,
    thing: opening.things[0].name,
    group: opening.things[0].group,
  });
  $("opening").hidden = true;
  $("desk").hidden = false;
  startPanes();
  for (const start of [startThings, startPulses, startNumbers, startPicture, startGeometry, startOrientation, startTracking, startCurves, startResults, startFiles, startTape]) start();
  startKeys(() => { drawSpeeds(); drawCurves(); drawResult(); drawTracking(); redraw(); });
  $("undo").addEventListener("click", () => void takeBack("undo"));
  $("redo").addEventListener("click", () => void takeBack("redo"));
  $("act-refine").addEventListener("click", () => void refineHere());
  $("act-accept").addEventListener("click", () => void accept(false));
  $("act-accept-all").addEventListener("click", () => void accept(true));
  watch(drawHead);
  startOperator();
}

function drawHead() {
  const { session, busy, cut } = state;
  $("undo").disabled = !session?.undo;
  $("redo").disabled = !session?.redo;
  $("act-accept").disabled = !state.view?.automatic[state.camera]?.[state.thing];
  $("act-accept-all").disabled = !cameras().some((camera) => Object.keys(state.view?.automatic[camera] ?? {}).length);
  setText($("busy"), cut ? t("digitize.cut") : busy ? t(busy) : "");
  $("busy").hidden = !cut && !busy;
}
