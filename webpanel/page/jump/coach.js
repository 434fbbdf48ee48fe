/**
 * The coach's screen, a television or a tablet that nobody touches: the last jump again and again with its figures, what
 * the cameras saw some seconds ago, and the code that opens the jump on the athlete's phone.
 */

import { say, t } from "../i18n/i18n.js";
import { call, Problem } from "../shared/api.js";
import { hear, wantPicture } from "../shared/connection.js";
import { $, make, setText } from "../shared/dom.js";
import { inLarge, levelOf, MARKS } from "../shared/figures.js";
import { number, timeOfDay } from "../shared/format.js";
import { howFar, latest, latestFigures, named } from "../shared/latest.js";
import { makeReplay } from "../shared/replay.js";
import { known, watch } from "../shared/store.js";
import { clearCode, showCode } from "./code.js";
import { makeDelay } from "./delayed.js";

/** So often the picture whose time has come is looked for, ms. */
const LOOK_MS = 100;
/** A code is made anew after so long: it holds for hours from when it was made. */
const CODE_MS = 10 * 60_000;

/** @typedef {import("../shared/types.js").Status} Status */

const delay = makeDelay();
/** @type {import("../shared/replay.js").Replay} */
let replay;
/** Seconds from the rig file; null: not known yet. @type {number|null} */
let delayS = null;
let asking = false;
/** Version of the service whose page this is. */
let version = "";
/** The recording whose code is shown, and when that was made. */
let code = { id: "", at: 0 };
/** The live picture that is shown. @type {Blob|null} */
let shown = null;
/** Whether live pictures are fetched. */
let running = false;

export function startCoach() {
  replay = makeReplay($("coach-replay"), { may: () => known.view === "coach" && known.connected && !known.status?.recording, button: false });
  hear({ picture: (image) => { if (running) delay.put(image); } });
  $("coach-live-image").addEventListener("load", () => URL.revokeObjectURL($("coach-live-image").src));
  setInterval(() => { if (known.view === "coach") look(); }, LOOK_MS);
  watch(draw);
}

/** Draw the words anew, in another language. */
export function drawCoach() {
  code.at = 0;
  replay.draw();
  draw();
}

function draw() {
  const { view, status, connected } = known;
  if (view !== "coach") return void (running && stop());
  if (status && version && status.version !== version) return location.reload(); // this page is of another version
  version = status?.version ?? version;
  if (connected && delayS === null) void askDelay();
  const wanted = connected && known.visible && ["armed", "recording"].includes(status?.state ?? "");
  if (wanted !== running) {
    running = wanted;
    wantPicture("coach", wanted);
  }
  drawState(status);
  drawJump();
}

function stop() {
  running = false;
  wantPicture("coach", false);
  delay.clear();
  replay.show("");
  clearCode($("coach-code"), $("coach-code-words"));
  code = { id: "", at: 0 };
}

async function askDelay() {
  if (asking) return;
  asking = true;
  try {
    const { settings } = await call("GET", "rig");
    delayS = settings.service?.coach_delay_s ?? 0;
  } catch (error) {
    if (!(error instanceof Problem)) throw error; // the next status asks again
  } finally {
    asking = false;
  }
}

/** @param {Status|null} status */
function drawState(status) {
  const lost = !known.connected;
  const level = lost ? "error" : status?.statement.level ?? "info";
  const state = status ? t(`state.${status.state}`) : "";
  $("coach-state").dataset.level = level;
  $("coach-state").dataset.state = lost ? "unknown" : status?.state;
  setText($("coach-state"), lost
    ? known.heard ? t("coach.lost", { time: timeOfDay(known.heard) }) : t("coach.connecting")
    : status && (level === "warning" || level === "error") ? say(status.statement).text : state);
}

function drawJump() {
  const { recording, measured } = latest;
  const figures = latestFigures();
  setText($("coach-who"), recording ? named(recording.session) : t("coach.nothing"));
  setText($("coach-time"), recording?.started ? timeOfDay(recording.started) : "");
  const level = figures && levelOf(figures);
  setText($("coach-mark"), level ? t(MARKS[level]) : "");
  $("coach-mark").dataset.level = level ?? "";
  setText($("coach-far"), recording ? howFar(measured, Boolean(figures)) : "");
  drawFigures(figures);
  replay.show(recording?.id ?? "", measured?.measured ?? "", figures?.jump);
  void drawCode(recording?.id ?? "");
}

/** @param {string} id of the last jump; "": there is none */
async function drawCode(id) {
  const [image, words] = [$("coach-code"), $("coach-code-words")];
  if (id !== code.id) {
    clearCode(image, words); // at once: nobody gets the jump of the one before
    code = { id, at: 0 };
  }
  if (!id || !known.connected || Date.now() - code.at < CODE_MS) return;
  code.at = Date.now();
  if (!await showCode(id, image, words, () => known.view === "coach" && code.id === id) && code.id === id) code.at = 0;
}

/** @param {import("../shared/types.js").LastJump|null} figures */
function drawFigures(figures) {
  const list = $("coach-figures");
  list.hidden = !figures;
  const rows = figures ? inLarge(figures) : [];
  if (list.children.length !== rows.length) {
    list.replaceChildren(...rows.map(() => make("div", {}, make("dt"), make("dd", {}, make("b"), make("span"), make("small")))));
  }
  rows.forEach(({ term, value, unit, beside }, index) => {
    const [name, content] = list.children[index].children;
    setText(name, term);
    [value, unit, beside].forEach((text, part) => setText(content.children[part], text));
  });
}

/** Show the live picture whose time has come. */
function look() {
  const now = running && delayS !== null ? delay.take(delayS) : null;
  const armed = ["armed", "recording"].includes(known.status?.state ?? "");
  $("coach-live-image").hidden = !now;
  setText($("coach-live-words"), now
    ? delayS ? t("coach.delayed", { seconds: number(delayS, delayS % 1 ? 1 : 0) }) : t("coach.now")
    : t(armed ? "coach.soon" : "coach.when_armed"));
  if (now && now !== shown) {
    $("coach-live-image").alt = t("coach.live_alt");
    $("coach-live-image").src = URL.createObjectURL(now);
  }
  shown = now;
}
