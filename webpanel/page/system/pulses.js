/** Who makes the pulses: slower, faster, kept in the rig file when somebody wishes that; stopped, started, on request. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { attempt, tell } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";

/** Rates that people use, pulses per second; every other one is for the REST API. */
const RATES = [1, 2, 5, 10, 15, 20, 25, 30, 40, 50, 60, 75, 90, 100, 120, 150, 200];
/** Pulses on request: some pictures of a scene in which nothing moves. */
const BURST = 10;
/** States in which a change is refused. */
const BUSY = ["arming", "recording", "disarming"];

/**
 * @typedef {object} Trigger
 * @property {string} source
 * @property {number} rate_hz
 * @property {string[]} controls
 * @property {boolean} saved
 */

/** @type {Trigger|null} */
let trigger = null;
/** The rate that is shown: the present one, or one that was chosen and is not in use yet. */
let wanted = 0;
let changing = false;

export function startPulses() {
  $("pulses-slower").addEventListener("click", () => choose(RATES.findLast((rate) => rate < wanted)));
  $("pulses-faster").addEventListener("click", () => choose(RATES.find((rate) => rate > wanted)));
  $("pulses-use").addEventListener("click", () => void take({ rate_hz: wanted }));
  $("pulses-run").addEventListener("click", () => void take({ running: !running() }));
  $("pulses-burst").addEventListener("click", () => void burst());
  $("pulses-save").addEventListener("click", () => void take({ save: true }));
  watch(drawPulses);
}

/** The view is entered: somebody else may have changed the rate. */
export async function enterPulses() {
  enter(await attempt(() => call("GET", "trigger")) ?? trigger);
}

export function drawPulses() {
  const controlled = trigger?.controls.includes("rate") ?? false;
  const state = known.status?.state ?? "";
  const locked = !trigger || changing || BUSY.includes(state);
  $("pulses-rate").hidden = !controlled;
  setText($("pulses-source"), trigger ? t(`pulses.${trigger.source}`, { rate: number(trigger.rate_hz, digits(trigger.rate_hz)) }) : "");
  setText($("pulses-fired"), fired());
  $("pulses-fired").hidden = !fired();
  setText($("pulses-wanted"), trigger ? t("pulses.per_second", { rate: number(wanted, digits(wanted)) }) : "–");
  $("pulses-slower").disabled = locked || wanted <= RATES[0];
  $("pulses-faster").disabled = locked || wanted >= RATES[RATES.length - 1];
  $("pulses-use").disabled = locked || wanted === trigger?.rate_hz;
  $("pulses-save").disabled = locked || (trigger?.saved ?? true);
  setText($("pulses-said"), words(state));
  drawTrain(state);
}

/** @param {string} state */
function drawTrain(state) {
  $("pulses-train").hidden = !(trigger?.controls.includes("running") && state === "armed");
  setText($("pulses-state"), t(running() ? "pulses.running" : "pulses.still"));
  $("pulses-state").dataset.level = running() ? "good" : "warning";
  setText($("pulses-run"), t(running() ? "pulses.stop" : "pulses.start"));
  $("pulses-run").classList.toggle("primary", !running());
  $("pulses-run").disabled = changing;
  setText($("pulses-burst"), t("pulses.burst", { pulses: BURST }));
  $("pulses-burst").hidden = running();
  $("pulses-burst").disabled = changing;
}

/** Whether pulses come by themselves: anybody may have stopped them. */
function running() {
  return known.status?.pulses.running ?? true;
}

/** What the source says of its own pulses. */
function fired() {
  const { fired: count = null, made = null } = known.status?.pulses ?? {};
  if (count === null) return "";
  if (!made?.skipped) return t("pulses.fired", { count: number(count) });
  return t("pulses.left_out", { count: number(count), skipped: number(made.skipped) });
}

/** @param {string} state */
function words(state) {
  if (!trigger) return "";
  if (state === "recording") return t("light.recording");
  if (state === "arming") return t("pulses.arming");
  if (wanted !== trigger.rate_hz) return t(state === "armed" ? "pulses.anew" : "pulses.not_yet");
  return t(trigger.saved ? "light.saved" : "light.unsaved");
}

/** @param {number|undefined} rate */
function choose(rate) {
  wanted = rate ?? wanted;
  drawPulses();
}

async function burst() {
  if (changing) return; // a double tap
  changing = true;
  drawPulses();
  await attempt(async () => {
    await call("POST", "trigger/burst", { pulses: BURST });
    tell("good", t("pulses.asked", { pulses: BURST }));
  });
  changing = false;
  drawPulses();
}

/** @param {{rate_hz?: number, running?: boolean, save?: boolean}} change */
async function take(change) {
  if (changing) return; // a double tap
  changing = true;
  drawPulses();
  await attempt(async () => {
    enter(await call("PATCH", "trigger", change));
    if (change.save) tell("good", t("pulses.kept"));
  });
  changing = false;
  drawPulses();
}

/** @param {Trigger|null} found */
function enter(found) {
  trigger = found;
  wanted = found?.rate_hz ?? 0;
  drawPulses();
}

/** @param {number} rate */
function digits(rate) {
  return Number.isInteger(rate) ? 0 : 2;
}
