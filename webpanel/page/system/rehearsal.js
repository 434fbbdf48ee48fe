/** The rehearsal: one button, how far it is, and the verdict of the last one in large words, with what to do. */

import { say, t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, fillList, icon, make, setText } from "../shared/dom.js";
import { day, number, quantity, timeOfDay } from "../shared/format.js";
import { tellProblem } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";
import { makeFindings } from "./findings.js";

/** The answer comes when the cameras are free. */
const END_DEADLINE_MS = 20_000;
/** Below this, a disk that has a bad moment loses frames: the figure is marked. */
const LITTLE_HEADROOM = 1.5;
const LEVELS = { ready: "good", warned: "warning", not_ready: "error", failed: "error" };

/** @typedef {import("../shared/types.js").Rehearsal} Rehearsal */

/** @type {Rehearsal|null} */
let last = null;
/** Whether a call has not been answered yet. */
let asking = false;
/** Whether a rehearsal ran when this was drawn last. */
let ran = false;

export function startRehearsal() {
  $("rehearse").addEventListener("click", () => ask("POST"));
  $("rehearse-end").addEventListener("click", () => ask("DELETE", END_DEADLINE_MS));
  watch(follow);
}

/** The view is entered: fetch the last verdict. */
export function enterRehearsal() {
  void look();
}

async function look() {
  try {
    ({ last } = await call("GET", "rehearsal"));
  } catch (error) {
    tellProblem(error);
  }
  draw();
}

/**
 * @param {string} method
 * @param {number} [deadlineMs]
 */
async function ask(method, deadlineMs) {
  if (asking) return;
  asking = true;
  draw();
  try {
    const { running } = await call(method, "rehearsal", undefined, deadlineMs);
    if (known.status) update({ status: { ...known.status, rehearsal: running } });
  } catch (error) {
    tellProblem(error);
  } finally {
    asking = false;
    draw();
  }
}

/** When a rehearsal is over, whoever asked for it, fetch its verdict. */
function follow() {
  const runs = Boolean(known.status?.rehearsal);
  if (ran && !runs && known.view === "doctor") void look();
  ran = runs;
  draw();
}

export function draw() {
  const { status } = known;
  const progress = status?.rehearsal ?? null;
  const idle = status?.state === "idle";
  $("rehearse").hidden = progress !== null;
  $("rehearse").disabled = !idle || asking || !known.connected || known.role === "watch";
  $("rehearse").setAttribute("aria-busy", String(asking));
  setText($("rehearse").querySelector("span"), t(last ? "rehearsal.again" : "rehearsal.run"));
  $("rehearsal-running").hidden = progress === null;
  $("rehearse-end").disabled = asking || !known.connected;
  $("rehearse-why").hidden = !status || idle;
  if (progress) {
    setText($("rehearsal-stage"), t(`rehearsal.${progress.stage}`, { done: progress.done, pulses: progress.pulses }));
    const bar = $("rehearsal-bar");
    if (progress.stage === "recording") [bar.max, bar.value] = [progress.pulses, progress.done];
    else bar.removeAttribute("value");
  }
  drawVerdict(progress === null ? last : null);
}

/** @param {Rehearsal|null} shown */
function drawVerdict(shown) {
  $("rehearsal-verdict").hidden = !shown;
  if (!shown) return;
  const { text, advice } = say(shown.statement);
  const level = LEVELS[shown.verdict];
  $("rehearsal-verdict").dataset.level = level;
  $("rehearsal-word").replaceChildren(icon(level), make("span", {}, t(`rehearsal.is_${shown.verdict}`)));
  setText($("rehearsal-time"), t("rehearsal.when", { day: day(shown.ended), time: timeOfDay(shown.ended) }));
  $("rehearsal-time").dateTime = shown.ended;
  setText($("rehearsal-text"), text);
  $("rehearsal-text").hidden = shown.verdict === "ready";
  const toDo = shown.verdict === "not_ready" ? adviceOf(shown) : advice;
  setText($("rehearsal-advice"), toDo);
  $("rehearsal-advice").hidden = !toDo;
  fillList($("rehearsal-figures"), figures(shown));
  $("rehearsal-everything").hidden = shown.findings.length === 0;
  $("rehearsal-findings").replaceChildren(makeFindings(shown.findings));
}

/**
 * What to do about the first thing that is wrong, in the language in use.
 *
 * @param {Rehearsal} shown
 */
function adviceOf({ findings, statement }) {
  const wrong = findings.find(({ level }) => level === "FAIL");
  return wrong ? say({ code: wrong.code, text: wrong.what, advice: wrong.remedy, values: wrong.values }).advice : statement.advice;
}

/**
 * @param {Rehearsal} shown
 * @returns {[string, string, string?][]}
 */
function figures({ headroom, jumps, spread_us, pulses, complete, verdict }) {
  if (verdict === "failed") return [];
  const narrow = Object.entries(headroom).sort((a, b) => a[1] - b[1])[0];
  /** @type {[string, string, string?][]} */
  const rows = narrow ? [[t("rehearsal.headroom", { what: narrow[0] === "disk" ? t("rehearsal.disk") : narrow[0] }), `${number(narrow[1], 1)}\u202f×`, narrow[1] < 1 ? "error" : narrow[1] < LITTLE_HEADROOM ? "warning" : ""]] : [];
  if (jumps !== null) rows.push([t("rehearsal.jumps"), number(jumps), jumps < 1 ? "error" : ""]);
  if (spread_us !== null) rows.push([t("rehearsal.spread"), quantity(spread_us, 0, "µs")]);
  rows.push([t("rehearsal.pulses"), `${number(complete)} / ${number(pulses)}`, complete < pulses ? "warning" : ""]);
  return rows;
}
