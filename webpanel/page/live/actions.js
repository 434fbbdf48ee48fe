/**
 * The buttons of the live view: a big one for the next step (arm, record, stop), "save the last jump", and disarm.
 *
 * A pressed button stays busy until the service has answered and reported its new state.
 */

import { say, t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { $, icon, make, setIcon, setText } from "../shared/dom.js";
import { quantity, who } from "../shared/format.js";
import { go } from "../shared/router.js";
import { tell, tellProblem } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";
import { sessionFields } from "./session.js";

/** Closing a log may wait for a slow disk. */
const STOP_DEADLINE_MS = 40_000;
const LEAST_PREROLL_S = 0.2;

/** @typedef {{ words: string, icon: string, busy: string, action: () => Promise<void> }} Step */

/** @type {Record<string, Step|null>} the next step by state; null: the rig takes it by itself */
const NEXT = {
  idle: { words: "actions.arm", icon: "armed", busy: "actions.arming", action: arm },
  fault: { words: "actions.arm_again", icon: "armed", busy: "actions.arming", action: arm },
  armed: { words: "actions.record", icon: "recording", busy: "actions.starting", action: record },
  recording: { words: "actions.stop", icon: "stop", busy: "actions.stopping", action: stop },
  arming: null,
  disarming: null,
  unknown: null,
};

export function startActions() {
  $("next-step").addEventListener("click", nextStep);
  $("save-last").addEventListener("click", saveLast);
  $("disarm").addEventListener("click", disarm);
  watch(draw);
}

/** Take the next step, which the big button names. */
export function nextStep() {
  const step = NEXT[known.status?.state ?? "unknown"];
  if (step && possible()) void perform(step.busy, step.action);
}

/** Record the seconds that are held in memory. */
export function saveLast() {
  if (known.status?.state === "armed" && possible() && held() >= LEAST_PREROLL_S) void perform("actions.saving", save);
}

/** Close the cameras. */
export function disarm() {
  if (mayDisarm() && possible()) void perform("actions.disarming", async () => { await call("POST", "disarm"); });
}

async function arm() {
  await call("POST", "arm");
}

async function record() {
  await call("POST", "recordings", sessionFields());
}

async function stop() {
  const id = known.status?.recording?.id;
  if (id) announce(await call("POST", recordingPath(id, "/stop"), undefined, STOP_DEADLINE_MS));
}

async function save() {
  announce(await call("POST", "recordings", { ...sessionFields(), duration_s: 0 }, STOP_DEADLINE_MS));
}

/** @param {import("../shared/types.js").Recording} recording */
function announce(recording) {
  const { level, text } = { level: recording.verdict.level, text: say(recording.verdict).text };
  const saved = t("actions.saved", { who: who(recording.session, recording.id), verdict: text });
  tell(level === "error" ? "warning" : level, saved, { words: t("actions.view"), action: () => go(`recordings/${recording.id}`) });
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
    tellProblem(error);
  } finally {
    update({ busy: "" });
  }
}

function possible() {
  return known.connected && !known.busy;
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
  drawButton($("next-step"), known.busy || !step ? "arming" : step.icon, t(words));
  $("next-step").dataset.step = step ? state : "wait";
  $("next-step").disabled = !step || !possible();
  $("next-step").setAttribute("aria-busy", String(Boolean(known.busy) || !step));
  $("save-last").hidden = state !== "armed";
  const nothingHeld = held() < LEAST_PREROLL_S;
  drawButton($("save-last"), "save", t("actions.save_last"), quantity(held(), 1, "s"));
  $("save-last").disabled = !possible() || nothingHeld;
  $("disarm").hidden = !mayDisarm();
  $("disarm").disabled = !possible();
  setText($("disarm"), t(state === "arming" ? "actions.cancel" : "actions.disarm"));
  drawReason(state === "armed" && nothingHeld);
}

/** @param {boolean} nothingHeld */
function drawReason(nothingHeld) {
  let reason = "";
  if (!known.connected) reason = t("actions.no_connection");
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
