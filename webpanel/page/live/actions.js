/**
 * The buttons of the live view: a big one for the next step (arm, record, stop), "save the last jump", and disarm.
 *
 * A pressed button stays busy until the service has answered and reported its new state.
 */

import { say, t } from "../i18n/i18n.js";
import { call, Problem, recordingPath } from "../shared/api.js";
import { $, icon, make, setIcon, setText } from "../shared/dom.js";
import { quantity, who } from "../shared/format.js";
import { go } from "../shared/router.js";
import { tell, tellProblem } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";
import { flush } from "./session.js";
import { onLongPress, seen, startTaps, waits, wantsLongPress } from "./taps.js";

/** Closing a log may wait for a slow disk. */
const STOP_DEADLINE_MS = 40_000;
const LEAST_PREROLL_S = 0.2;

/** How long the reason is shown why a tap did nothing. */
const REASON_MS = 5_000;
/** Refusals of taps that were hardly meant: said beside the button, and no error. */
const SECOND_TAPS = ["changed_meanwhile", "too_soon", "confirm_first"];

/** Why the last tap did nothing. */
let refused = "";
let refusedTimer = 0;

/** @typedef {{ words: string, icon: string, busy: string, action: () => Promise<void> }} Step */

/** @type {Record<string, Step|null>} the next step by state; null: the rig takes it by itself */
const NEXT = {
  idle: { words: "actions.arm", icon: "armed", busy: "actions.arming", action: arm },
  fault: { words: "actions.arm_again", icon: "armed", busy: "actions.arming", action: arm },
  armed: { words: "actions.record", icon: "recording", busy: "actions.starting", action: record },
  recording: { words: "actions.stop", icon: "stop", busy: "actions.stopping", action: () => stop(false) },
  arming: null,
  disarming: null,
  unknown: null,
};

export function startActions() {
  $("next-step").addEventListener("click", nextStep);
  $("save-last").addEventListener("click", saveLast);
  $("arm-without").addEventListener("click", armWithout);
  $("disarm").addEventListener("click", disarm);
  onLongPress($("next-step"), () => known.status?.state === "recording" && possible(), () => void perform("actions.stopping", () => stop(true)));
  startTaps(draw);
  watch(draw);
}

function stopsByLongPress() {
  return known.status?.state === "recording" && wantsLongPress();
}

/** Take the next step, which the big button names. */
export function nextStep() {
  const step = NEXT[known.status?.state ?? "unknown"];
  if (!step || !possible() || waits() && !stopsByLongPress()) return;
  if (stopsByLongPress()) refuse(t("actions.hold_to_stop"));
  else void perform(step.busy, step.action);
}

/** Record the seconds that are held in memory. */
export function saveLast() {
  if (known.status?.state === "armed" && possible() && !waits() && held() >= LEAST_PREROLL_S) void perform("actions.saving", save);
}

/** Arm with the cameras that answer. */
function armWithout() {
  const lacking = lackingCameras();
  if (lacking && possible()) void perform("actions.arming", async () => { await call("POST", "arm", { min_cameras: lacking.present }); });
}

/** Close the cameras. */
export function disarm() {
  if (mayDisarm() && possible()) void perform("actions.disarming", async () => { await call("POST", "disarm"); });
}

async function arm() {
  await call("POST", "arm");
}

async function record() {
  const order = { seen: seen() };
  await flush();
  await call("POST", "recordings", order);
}

/** @param {boolean} confirm whether it was a long press */
async function stop(confirm) {
  const id = known.status?.recording?.id;
  if (id) announce(await call("POST", recordingPath(id, "/stop"), { seen: seen(), confirm }, STOP_DEADLINE_MS));
}

async function save() {
  const order = { seen: seen(), duration_s: 0 };
  await flush();
  const { id } = await call("POST", "recordings", order, STOP_DEADLINE_MS);
  announce(await call("POST", recordingPath(id, "/stop"), undefined, STOP_DEADLINE_MS)); // answers when it is whole
}

/** @param {import("../shared/types.js").Recording} recording */
function announce(recording) {
  const { level, text } = { level: recording.verdict.level, text: say(recording.verdict).text };
  const saved = t("actions.saved", { who: who(recording.session, recording.id), verdict: text });
  tell(level === "error" ? "warning" : level, saved, { words: t("actions.view"), action: () => go(`recordings/${encodeURIComponent(recording.id)}`) });
}

/**
 * Keep the buttons busy until the service has answered and said how it stands now.
 *
 * @param {string} words key of the words that the buttons show meanwhile
 * @param {() => Promise<void>} action
 */
async function perform(words, action) {
  update({ busy: words });
  try {
    await action();
    update({ status: await call("GET", "status"), heard: Date.now() });
  } catch (error) {
    if (error instanceof Problem && SECOND_TAPS.includes(error.code)) refuse(say(error.said).text);
    else tellProblem(error);
  } finally {
    update({ busy: "" });
  }
}

/**
 * Say beside the button why a tap did nothing.
 *
 * @param {string} words
 */
function refuse(words) {
  refused = words;
  clearTimeout(refusedTimer);
  refusedTimer = setTimeout(() => { refused = ""; draw(); }, REASON_MS);
  draw();
}

function possible() {
  return known.connected && !known.busy && known.role !== "watch";
}

function held() {
  return known.status?.preroll.seconds ?? 0;
}

function mayDisarm() {
  return ["arming", "armed", "fault"].includes(known.status?.state ?? "");
}

function draw() {
  const state = known.status?.state ?? "unknown";
  const step = NEXT[state];
  const words = known.busy || step?.words || `actions.wait_${state}`;
  drawButton($("next-step"), known.busy || !step ? "arming" : step.icon, t(words), known.busy ? "" : more(state));
  $("next-step").dataset.step = step ? state : "wait";
  const heldUp = Boolean(step) && waits() > 0 && !stopsByLongPress();
  $("next-step").disabled = !step || !possible() || heldUp;
  $("next-step").classList.toggle("waits", heldUp);
  $("next-step").setAttribute("aria-busy", String(Boolean(known.busy) || !step));
  $("save-last").hidden = state !== "armed";
  const nothingHeld = held() < LEAST_PREROLL_S;
  drawButton($("save-last"), "save", t("actions.save_last"), quantity(held(), 1, "s"));
  $("save-last").disabled = !possible() || nothingHeld || waits() > 0;
  drawArmWithout();
  $("disarm").hidden = !mayDisarm();
  $("disarm").disabled = !possible();
  setText($("disarm"), t(state === "arming" ? "actions.cancel" : "actions.disarm"));
  drawReason(state === "armed" && nothingHeld && !known.status?.pulses.arriving);
}

/** In a fault because some cameras do not answer: arm without them. */
function drawArmWithout() {
  const lacking = lackingCameras();
  $("arm-without").hidden = !lacking;
  $("arm-without").disabled = !possible();
  if (lacking) drawButton($("arm-without"), "armed", t("actions.arm_without", lacking));
}

/** @returns {import("../shared/types.js").Values|null} values of the statement that too few cameras answer; null in other states */
function lackingCameras() {
  const statement = known.status?.statement;
  return statement?.code === "fault_too_few" ? statement.values : null;
}

/**
 * What stands below the word on the big button: whom it records, how it stops, or how long it waits.
 *
 * @param {string} state
 */
function more(state) {
  if (stopsByLongPress()) return t("actions.hold");
  if (waits() > 0) return t("actions.wait", { seconds: Math.ceil(waits()) });
  if (state !== "armed" || !known.status) return "";
  return who(known.status.next_jumper.session, t("recordings.nobody"));
}

/** @param {boolean} nothingHeld */
function drawReason(nothingHeld) {
  let reason = "";
  if (!known.connected) reason = t("actions.no_connection");
  else if (refused) reason = refused;
  else if (nothingHeld && !known.busy) reason = t("actions.nothing_held");
  setText($("action-reason"), reason);
  $("action-reason").hidden = !reason;
}

/**
 * @param {HTMLElement} button
 * @param {string} picture
 * @param {string} words
 * @param {string} [more] below the words
 */
function drawButton(button, picture, words, more = "") {
  if (!button.children.length) button.append(icon(picture), make("span", {}, make("span"), make("small")));
  const [image, text] = button.children;
  setIcon(image, picture);
  setText(text.children[0], words);
  setText(text.children[1], more);
}
