/** Exposure and gain of one camera: darker, brighter, and kept in the rig file when somebody wishes that. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { attempt, tell } from "../shared/snacks.js";
import { known } from "../shared/store.js";

/** A third of a stop, as on a camera. */
const STEP = 2 ** (1 / 3);
const GAIN_STEP_DB = 1;

/** @typedef {import("./types.js").CameraLight} CameraLight */

/** Name of the camera that is shown. */
let camera = "";
/** @type {CameraLight|null} */
let light = null;
let changing = false;

export function startLight() {
  const steps = {
    "light-shorter": () => ({ exposure_us: rounded(at().exposure_us / STEP) }),
    "light-longer": () => ({ exposure_us: rounded(at().exposure_us * STEP) }),
    "light-less": () => ({ gain_db: Math.max(0, at().gain_db - GAIN_STEP_DB) }),
    "light-more": () => ({ gain_db: at().gain_db + GAIN_STEP_DB }),
    "light-save": () => ({ save: true }),
  };
  for (const [id, change] of Object.entries(steps)) $(id).addEventListener("click", () => void take(change));
}

/**
 * Show the exposure of a camera; ask for it when another one is shown.
 *
 * @param {string} name
 */
export function lightOf(name) {
  if (name !== camera) {
    [camera, light] = [name, null];
    if (name) void attempt(async () => { enter(await call("GET", path(name))); });
  }
  drawLight();
}

function drawLight() {
  const locked = !light || changing || known.status?.state === "recording";
  for (const id of ["light-shorter", "light-longer", "light-less", "light-more"]) $(id).disabled = locked;
  $("light-less").disabled ||= light?.gain_db === 0;
  $("light-save").disabled = locked || (light?.saved ?? true);
  setText($("light-exposure"), light ? t("light.ms", { value: number(light.exposure_us / 1000, light.exposure_us < 995 ? 3 : 2) }) : "–");
  setText($("light-gain"), light ? t("light.db", { value: number(light.gain_db, 1) }) : "–");
  setText($("light-said"), !light ? "" : known.status?.state === "recording" ? t("light.recording") : t(light.saved ? "light.saved" : "light.unsaved"));
}

/** @param {() => object} change */
async function take(change) {
  if (changing || !light) return; // a double tap, or the answer to the last one has not come
  changing = true;
  drawLight();
  const name = camera;
  await attempt(async () => {
    const { save } = /** @type {{save?: boolean}} */ (change());
    enter(await call("PATCH", path(name), change()));
    if (save) tell("good", t("light.kept", { camera: name }));
  });
  changing = false;
  drawLight();
}

/** @param {CameraLight} found */
function enter(found) {
  if (found.camera === camera) light = found;
  drawLight();
}

/** @returns {Pick<CameraLight, "exposure_us"|"gain_db">} */
function at() {
  return light ?? { exposure_us: 0, gain_db: 0 };
}

/** @param {number} value three digits */
function rounded(value) {
  return Number(value.toPrecision(3));
}

/** @param {string} name */
function path(name) {
  return `cameras/${encodeURIComponent(name)}`;
}
