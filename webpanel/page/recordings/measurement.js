/** What was measured in the recording shown: how far that is, its jumps with their figures, files, why it failed; measures it (again). */

import { languageInUse, say, t } from "../i18n/i18n.js";
import { call, partOf, Problem, recordingPath } from "../shared/api.js";
import { $, icon, make, makeMark, setText } from "../shared/dom.js";
import { fillFigures, levelOf, MARKS, verdictOf } from "../shared/figures.js";
import { day, number, timeOfDay } from "../shared/format.js";
import { filesOf } from "../shared/resultfiles.js";
import { place } from "../shared/router.js";
import { attempt, tell, tellProblem } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";
import { jumpShown, offerJumps, onJump } from "../viewing/jumps.js";
import { KINOGRAM, showKinogram } from "./kinogram.js";
import { makeSteps } from "./steps.js";
import { showJump } from "./jump.js";

/** @typedef {import("./types.js").Measurement} Measurement */
/** @typedef {import("../shared/types.js").LastJump} LastJump */

const QUEUED = ["waiting", "measuring"];
/** Files of the result that people open, in this order; any others come after them, folded away. */
const FILES = [/^report\.html$/, /^overlay\.mp4$/, /\.c3d$/, /\.trc$/, /\.csv$/, /^protocol\.html$/];
/** What the browser shows itself instead of keeping it. */
const SHOWN = /\.(html|txt|mp4)$/;

/** @type {import("../shared/types.js").Recording|null} */
let recording = null;
/** @type {Measurement|null} */
let measured = null;
/** Number of the call that was made last: the answers to those before it are old. */
let calls = 0;
/** Whether an order has not been answered yet. */
let ordering = false;
/** The queue of which the service told last: when it is another one, this recording may be in it, or not any more. */
let queue = "";
/** What `drawResult` has drawn. */
let drawn = "";

export function startMeasurement() {
  $("measurement-measure").addEventListener("click", () => void order("POST"));
  $("measurement-cancel").addEventListener("click", () => void order("DELETE"));
  onJump(draw);
  watch(follow);
}

/**
 * Show what was measured in a recording.
 *
 * @param {import("../shared/types.js").Recording|null} shown null: none is shown
 */
export async function loadMeasurement(shown) {
  if (shown?.id !== recording?.id) measured = null;
  recording = shown;
  draw();
  await look();
}

/** Draw how far it is; if the queue has changed, ask for what that means for this recording. */
function follow() {
  const now = known.status?.measuring;
  const before = queue;
  if (now) queue = `${now.recording} ${now.state} ${now.paused} ${now.waiting} ${now.step === "writing"}`; // figures come before files
  if (queue !== before) void attempt(look);
  draw();
}

/** Whether the recording can have been measured, or be measured: it has ended, and is not in the trash. */
function isMeasurable() {
  return recording !== null && recording.state !== "recording" && !recording.deleted;
}

async function look() {
  if (!recording || !isMeasurable() || place().id !== recording.id) return;
  await take("GET");
}

/** @param {"GET"|"POST"|"DELETE"} method */
async function take(method) {
  const [id, own] = [recording?.id ?? "", ++calls];
  const answer = await call(method, recordingPath(id, method === "GET" ? "/measurement?jumps=false" : "/measurement"));
  if (own !== calls || recording?.id !== id) return;
  measured = answer;
  draw();
}

/** @param {"POST"|"DELETE"} method */
async function order(method) {
  if (ordering) return;
  ordering = true;
  draw();
  try {
    await take(method);
  } catch (error) {
    if (error instanceof Problem && error.code === "state_forbids") tell("error", t("measurement.refused", { why: say(error.detail).text }));
    else tellProblem(error);
  } finally {
    ordering = false;
    draw();
  }
}

function draw() {
  $("measurement").hidden = !recording;
  showKinogram(recording, isMeasurable() ? measured : null);
  $("jump-verdict").hidden = !recording;
  if (!recording) return void attempt(() => showJump(null));
  const shown = isMeasurable() ? measured : null;
  void attempt(() => showJump(shown));
  $("measurement-known").hidden = $("jump-verdict").hidden = !shown;
  if (!shown) {
    setText($("measurement-state"), isMeasurable() ? "" : t(recording.deleted ? "measurement.trash" : "measurement.after"));
    for (const part of ["measurement-share", "measurement-bar"]) $(part).hidden = true;
    return;
  }
  drawProgress(shown);
  drawResult(shown);
  const queued = QUEUED.includes(shown.state);
  const idle = known.connected && !ordering;
  setText($("measurement-measure").querySelector("span"), t(shown.measured ? "measurement.again" : "measurement.measure"));
  $("measurement-measure").hidden = Boolean(shown.refused) && !queued; // the state says why
  $("measurement-measure").disabled = queued || !idle;
  $("measurement-cancel").hidden = !queued;
  $("measurement-cancel").disabled = !idle;
}

/** @param {Measurement} shown */
function drawProgress(shown) {
  const now = known.status?.measuring;
  const { paused, step, share } = now && now.recording === shown.recording && shown.state === "measuring" ? now : shown;
  const begun = shown.state === "measuring" && !paused && step !== null;
  setText($("measurement-state"), inWords(shown, paused, step));
  setText($("measurement-share"), begun ? `${number(100 * share)}\u202f%` : "");
  $("measurement-share").hidden = $("measurement-bar").hidden = !begun;
  $("measurement-bar").value = share;
  $("measurement-steps").replaceChildren(...makeSteps(shown.steps));
}

/**
 * How far the measuring is, without the share of the step: that changes too often to be read out.
 *
 * @param {Measurement} shown
 * @param {boolean} paused
 * @param {Measurement["step"]} step
 */
function inWords({ state, before, measured: then, version, figures, live, refused, again, renaming }, paused, step) {
  const why = refused && state !== "done" ? say(refused) : null;
  const unable = why ? t("measurement.refused", { why: `${why.text}: ${why.advice}.` }) : "";
  const when = { day: then ? day(then) : "", time: then ? timeOfDay(then) : "" };
  const old = figures.length && !live && then ? t("measurement.earlier", when) : "";
  const sentences = {
    none: [t(live ? "measurement.live" : "measurement.none")],
    waiting: [before ? t("measurement.waiting", { before }) : t("measurement.next"), known.status?.recording ? t("measurement.while_recording") : "", old],
    measuring: paused
      ? [t("measurement.paused"), old]
      : [old, step ? t("measurement.running", { step: t(`measurement.step_${step}`) }) : t("measurement.begun")], // the share follows
    done: [t("measurement.done", { ...when, version }), figures.length ? "" : t("measurement.no_jump")],
    failed: [t("measurement.failed"), again ? t("measurement.by_itself") : "", old],
  };
  return [...sentences[state], renaming ? t("measurement.renaming") : "", unable].filter(Boolean).join(" ");
}

/**
 * Draw problem, jumps and files, if they are others than before.
 *
 * @param {Measurement} shown
 */
function drawResult({ recording: id, state, problem, figures, live, files }) {
  offerJumps(figures.map((jump) => ({ number: jump.jump, level: levelOf(jump, live) })));
  const place = Math.max(0, figures.findIndex(({ jump }) => jump === jumpShown()));
  const now = JSON.stringify([languageInUse(), id, state === "failed" ? problem : null, figures, live, files, place]);
  if (now === drawn) return;
  drawn = now;
  const failed = state === "failed" ? problem : null;
  const { text, advice } = failed ? say(failed) : { text: "", advice: "" };
  $("measurement-problem").hidden = !failed;
  $("measurement-problem").replaceChildren(...failed ? [makeMark(failed.level, failed.level, text), ...advice ? [make("p", { class: "advice" }, advice)] : []] : []);
  const levels = figures.slice(place, place + 1).map((jump) => levelOf(jump, live)); // the choice has those of the others
  $("jump-verdict").replaceChildren(...levels.map((level) => makeMark(level, level, t(MARKS[level]))));
  $("measurement-jumps").replaceChildren(...figures.slice(place, place + 1).map((jump) => makeJump(jump, live, figures.length > 1)));
  const [first, rest] = sorted(files.filter((name) => !KINOGRAM.test(name)), place + 1);
  $("measurement-files").replaceChildren(...first.map((name) => makeFile(id, name)));
  $("measurement-more").hidden = !rest.length;
  $("measurement-others").replaceChildren(...rest.map((name) => makeFile(id, name)));
}

/**
 * The verdict on a jump, and its figures.
 *
 * @param {LastJump} jump
 * @param {boolean} live
 * @param {boolean} several whether it is one of several
 */
function makeJump(jump, live, several) {
  const figures = make("dl", { class: "figures" });
  fillFigures(figures, jump);
  const level = levelOf(jump, live);
  return make("section", {},
    several ? make("h3", {}, t("measurement.jump", { jump: jump.jump, time: timeOfDay(jump.time) })) : null,
    makeMark(level, level, t(MARKS[level])),
    make("p", { class: "measured-why" }, verdictOf(jump)),
    figures);
}

/**
 * The files of a jump that people open, in order, and the others but for those of other jumps.
 *
 * @param {string[]} files
 * @param {number} order of the jump in its recording
 * @returns {[string[], string[]]}
 */
function sorted(files, order) {
  const own = filesOf(files, order);
  const first = FILES.flatMap((kind) => own.filter((name) => kind.test(name)));
  return [first, own.filter((name) => !first.includes(name))];
}

/**
 * @param {string} id
 * @param {string} name
 */
function makeFile(id, name) {
  const file = { href: partOf(id, `measurement/files/${encodeURIComponent(name)}`), ...SHOWN.test(name) ? { target: "_blank", rel: "noopener" } : { download: "" } };
  if (name === "report.html") return make("a", { class: "button big primary", ...file }, icon("play"), make("span", {}, t("measurement.report")));
  return make("a", { class: "button", ...file }, icon(SHOWN.test(name) ? "log" : "download"), make("span", {}, named(name)));
}

/** @param {string} name of a file */
function named(name) {
  if (name === "protocol.html") return t("measurement.protocol");
  if (name === "overlay.mp4") return t("measurement.video");
  const [, order, kind] = name.match(/^jumper(?:-(\d+))?\.(c3d|trc|csv)$/) ?? [];
  if (!kind) return name;
  return order ? t("measurement.file_of", { kind: kind.toUpperCase(), jump: order }) : kind.toUpperCase();
}
