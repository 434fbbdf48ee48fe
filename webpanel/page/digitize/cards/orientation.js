/** Whether the cameras are oriented, with what was found out, and orienting by the balls that were clicked. */

import { say, t } from "../../i18n/i18n.js";
import { $, icon, make, setText } from "../../shared/dom.js";
import { attempt } from "../../shared/snacks.js";
import { getOpening, orient } from "../session/server.js";
import { reloadAll } from "../session/session.js";
import { change, redraw, state, watch } from "../session/state.js";

const LOOK_AGAIN_MS = 1000;
/** @type {Record<import("../types.js").OrientationState["state"], [import("../../shared/types.js").Level, string]>} */
const STATES = {
  none: ["info", "digitize.oriented_none"], working: ["info", "digitize.oriented_working"],
  done: ["good", "digitize.oriented_done"], failed: ["error", "digitize.oriented_failed"],
};
let looking = false;

export function startOrientation() {
  $("orient-clicked").addEventListener("click", () => void begin(state.operator));
  $("orient-found").addEventListener("click", () => void begin(""));
  watch(draw);
  void follow();
}

/** @param {string} operator whose balls; "": those that the images show */
async function begin(operator) {
  const orientation = await attempt(() => orient(operator));
  if (!orientation || !state.opening) return;
  change({ opening: { ...state.opening, orientation } });
  await follow();
}

/** While the cameras are being oriented, look how far it is; then load what follows from it. */
async function follow() {
  if (looking || state.opening?.orientation.state !== "working") return;
  looking = true;
  while (state.opening?.orientation.state === "working") {
    await new Promise((resolve) => { setTimeout(resolve, LOOK_AGAIN_MS); });
    const opening = await attempt(getOpening);
    if (opening) change({ opening });
  }
  looking = false;
  await reloadAll();
}

/** What is shown; it is made anew only when that changes. */
let shown = "";

function draw() {
  const { opening, session } = state;
  if (!opening) return;
  const { state: how, message, findings } = opening.orientation;
  const clicked = Object.entries(session?.balls ?? {}).map(([camera, balls]) => `${camera} ${Object.keys(balls).length}`);
  const now = JSON.stringify([opening.orientation, opening.cameras, clicked, document.documentElement.lang]);
  if (now === shown) return;
  shown = now;
  const [level, words] = STATES[how];
  const missing = how === "done" ? opening.cameras.filter(({ oriented }) => !oriented).map(({ name }) => name) : [];
  $("orientation-lamp").dataset.level = level;
  $("orientation-lamp").replaceChildren(icon(level), make("span", {}, t(words)));
  setText($("orientation-message"), message ? say(message).text : "");
  $("orientation-findings").replaceChildren(
    ...missing.map((camera) => make("li", {}, t("digitize.not_oriented", { camera }))), ...findings.map((finding) => make("li", {}, say(finding).text)));
  setText($("orientation-clicked"), clicked.length ? t("digitize.balls_clicked", { balls: clicked.join(", ") }) : t("digitize.balls_none"));
  for (const part of ["orient-clicked", "orient-found"]) $(part).disabled = how === "working";
  redraw();
}
