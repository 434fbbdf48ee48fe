/** The last jump: the recording that ended last and what was measured in it. It is the same for all parts of the page. */

import { t } from "../i18n/i18n.js";
import { call, Problem, recordingPath } from "./api.js";
import { hear } from "./connection.js";
import { known, update, watch } from "./store.js";

/** @typedef {import("./types.js").LastJump} LastJump */
/** @typedef {import("./types.js").Recording} Recording */

/**
 * What is needed of the answer about a measurement.
 *
 * @typedef {{ state: import("./types.js").MeasuringQueue["state"], paused: boolean, before: number, measured: string|null,
 *   figures: LastJump[], live: boolean, files: string[], renaming: boolean, problem: import("./types.js").Statement|null }} Measured
 */

/** Code of the problem that the analysis finds no jumper in a log. */
const NO_JUMPER = "why_no_jump";

/** @type {{ recording: Recording|null, measured: Measured|null }} */
export const latest = { recording: null, measured: null };

/** What the status said when it was asked last: with the same words there is nothing new. */
let asked = "";
/** Number of the question that was asked last: the answers to those before it are old. */
let questions = 0;

let started = false;

/** Keep it up to date from now on. */
export function startLatest() {
  if (started) return; // another part of the page needs it too
  started = true;
  hear({ recordings: () => void load(true) });
  watch(() => void load(false));
}

/** @param {boolean} again also if the status says the same: somebody may have changed the recording */
async function load(again) {
  const { status, connected } = known;
  if (!status || !connected) return;
  const { recording, state, paused, waiting } = status.measuring;
  const said = JSON.stringify([status.last_recording, status.last_jump, recording, state, paused, waiting]);
  if (said === asked && !again) return;
  asked = said;
  const own = ++questions;
  try {
    const found = await find(status.last_jump);
    if (own !== questions) return;
    Object.assign(latest, found);
    update({});
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (own === questions) asked = ""; // with the next status; what is known stays, and the banner says what is wrong
  }
}

/**
 * @param {LastJump|null} jump that was measured last
 * @returns {Promise<typeof latest>}
 */
async function find(jump) {
  const newest = await call("GET", "recordings?limit=2");
  const ended = newest.find((/** @type {Recording} */ each) => each.state !== "recording");
  if (!ended) return { recording: null, measured: null };
  const measured = await measurementOf(ended.id);
  if (!jump || jump.recording === ended.id || !isWithoutJumper(measured)) return { recording: ended, measured };
  const before = await call("GET", recordingPath(jump.recording));
  return before.deleted ? { recording: ended, measured } : { recording: before, measured: await measurementOf(before.id) };
}

/**
 * Whether it was measured, and nobody jumps in it: then the last jump is the one before.
 *
 * @param {Measured} measured
 */
function isWithoutJumper({ state, problem, figures }) {
  return !figures.length && (state === "done" || state === "failed" && problem?.code === NO_JUMPER);
}

/**
 * What was measured in a recording, its main figures only.
 *
 * @param {string} id
 * @returns {Promise<Measured>}
 */
export function measurementOf(id) {
  return call("GET", recordingPath(id, "/measurement?jumps=false"));
}

/**
 * The figures of the last jump; null: there are none (yet).
 *
 * @returns {LastJump|null}
 */
export function latestFigures() {
  const { recording, measured } = latest;
  const told = known.status?.last_jump ?? null;
  if (recording && told?.recording === recording.id) return told;
  return measured?.figures.at(-1) ?? null;
}

/**
 * Bib and name; what has no name says so.
 *
 * @param {{ bib: string, athlete: string }} session
 */
export function named({ bib, athlete }) {
  return [bib, athlete || t("jump.unnamed")].filter(Boolean).join(" · ");
}

/**
 * How far the measuring of a jump is; empty if its figures are final.
 *
 * @param {Measured|null} measured
 * @param {boolean} figures whether there are any
 */
export function howFar(measured, figures) {
  if (!measured) return "";
  const { state, paused, before } = measured;
  return {
    none: figures ? "" : t("jump.not_measured"),
    waiting: before ? t("jump.waiting_behind", { before }) : t("jump.waiting"),
    measuring: t(paused ? "jump.paused" : "jump.measuring"),
    done: figures ? "" : t("jump.nobody"),
    failed: t(isWithoutJumper(measured) ? "jump.nobody" : "jump.failed"),
  }[state];
}
