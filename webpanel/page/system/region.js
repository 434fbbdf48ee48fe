/** The part of the sensor that a camera reads out: changed, given back if the camera refuses, kept in the rig file. */

import { say, t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { attempt, tell } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";

/** The answer comes when the rig is armed with the region, or begins to go back. */
const DEADLINE_MS = 60_000;
/** States in which a change is refused. */
const BUSY = ["arming", "recording", "disarming"];

/** @typedef {import("./types.js").CameraLight} CameraLight */
/** @typedef {import("./types.js").Region} Region */
/** @typedef {"x"|"y"|"width"|"height"} Side */

/** @type {Side[]} */
const SIDES = ["x", "y", "width", "height"];

/** Name of the camera that is shown. */
let camera = "";
/** @type {CameraLight|null} */
let found = null;
let changing = false;
/** The state of the rig when it was drawn last: cameras that have just been connected have told their limits. */
let before = "";

export function startRegion() {
  for (const side of SIDES) field(side).addEventListener("input", drawRegion);
  $("region-whole").addEventListener("click", () => { fill(whole()); drawRegion(); });
  $("region-form").addEventListener("submit", (/** @type {Event} */ event) => {
    event.preventDefault();
    void take({ region: wanted() });
  });
  $("region-save").addEventListener("click", () => void take({ save: true }));
  watch(drawRegion);
}

/** The view is entered: somebody else may have changed the region, and a camera that was connected tells its limits. */
export async function enterRegion() {
  const name = camera;
  if (!name) return;
  const answer = await attempt(() => call("GET", path(name)));
  if (answer && name === camera) enter(answer);
}

export function drawRegion() {
  if (known.view !== "doctor") return;
  drawCameras();
  const state = known.status?.state ?? "";
  if (state === "armed" && before !== state && found && !found.limits) void enterRegion();
  before = state;
  const limits = found?.limits ?? null;
  const locked = !found || changing || BUSY.includes(state);
  const [size, place] = [{ x: limits?.step_x, y: limits?.step_y, width: limits?.step_width, height: limits?.step_height }, whole()];
  for (const side of SIDES) {
    const input = field(side);
    input.disabled = locked;
    input.step = String(size[side] ?? 1);
    input.min = String({ x: 0, y: 0, width: limits?.least_width ?? 1, height: limits?.least_height ?? 1 }[side]);
    input.max = limits ? String({ x: limits.width, y: limits.height, width: place.width, height: place.height }[side]) : "";
  }
  $("region-whole").disabled = locked || !limits;
  $("region-use").disabled = locked || same();
  $("region-use").setAttribute("aria-busy", String(changing));
  $("region-save").disabled = locked || (found?.saved ?? true);
  setText($("region-limits"), !found ? "" : limits ? t("region.limits", { ...limits }) : t("region.no_limits"));
  setText($("region-said"), words());
  const unfit = found?.calibration ? say(found.calibration) : null;
  $("region-unfit").hidden = !unfit;
  setText($("region-unfit").firstElementChild, unfit?.text ?? "");
  setText($("region-unfit").lastElementChild, unfit?.advice ?? "");
}

function drawCameras() {
  const names = (known.status?.cameras ?? []).map(({ name }) => name);
  const buttons = $("region-cameras");
  if ([...buttons.children].map((button) => button.textContent).join() !== names.join()) {
    buttons.replaceChildren(...names.map((name) => make("button", { type: "button", onclick: () => choose(name) }, name)));
  }
  if (!names.includes(camera) && names.length) choose(names[0]);
  for (const button of buttons.children) button.setAttribute("aria-pressed", String(button.textContent === camera));
}

/** @param {string} name */
function choose(name) {
  [camera, found] = [name, null];
  void enterRegion();
  drawRegion();
}

function words() {
  const state = known.status?.state;
  if (!found) return "";
  if (state === "recording") return t("light.recording");
  if (changing) return t("region.trying");
  if (state === "arming") return t("pulses.arming");
  if (!same()) return t(state === "armed" ? "pulses.anew" : "pulses.not_yet");
  return t(found.saved ? "light.saved" : "light.unsaved");
}

/** @param {{region?: Region, save?: boolean}} change */
async function take(change) {
  if (changing) return; // a double tap
  changing = true;
  drawRegion();
  const name = camera;
  await attempt(async () => {
    const answer = await call("PATCH", path(name), change, DEADLINE_MS);
    if (name === camera) enter(answer);
    if (change.save) tell("good", t("light.kept", { camera: name }));
  });
  changing = false;
  drawRegion();
}

/** @param {CameraLight} answer */
function enter(answer) {
  found = answer;
  fill(answer.region);
  drawRegion();
}

/** @returns {Region} the largest that the steps of the camera allow */
function whole() {
  const { limits } = found ?? {};
  if (!limits) return found?.region ?? { x: 0, y: 0, width: 0, height: 0 };
  const most = (/** @type {number} */ size, /** @type {number} */ least, /** @type {number} */ step) => size - ((size - least) % step);
  return {
    x: 0, y: 0,
    width: most(limits.width, limits.least_width, limits.step_width),
    height: most(limits.height, limits.least_height, limits.step_height),
  };
}

/** @returns {Region} what stands in the fields */
function wanted() {
  return { x: field("x").valueAsNumber, y: field("y").valueAsNumber, width: field("width").valueAsNumber, height: field("height").valueAsNumber };
}

function same() {
  const [one, other] = [wanted(), found?.region];
  return SIDES.every((side) => one[side] === other?.[side]);
}

/** @param {Region} region */
function fill(region) {
  for (const side of SIDES) field(side).value = String(region[side]);
}

/**
 * @param {Side} side
 * @returns {HTMLInputElement}
 */
function field(side) {
  return $(`region-${side}`);
}

/** @param {string} name */
function path(name) {
  return `cameras/${encodeURIComponent(name)}`;
}
