/** The switch that has recordings begin by themselves, if the rig file lets a camera be watched for that. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { tell, tellProblem } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";

export function startAutomatic() {
  $("automatic-on").addEventListener("change", () => void change($("automatic-on").checked));
  watch(draw);
}

function draw() {
  const automatic = known.status?.automatic;
  $("automatic").hidden = !automatic;
  if (!automatic) return;
  $("automatic-on").checked = automatic.on;
  $("automatic-on").disabled = !known.connected || known.role === "watch";
  setText($("automatic").querySelector("span"), t("actions.automatic", { camera: automatic.camera }));
}

/**
 * Tell the service, and offer to take it back.
 *
 * @param {boolean} on
 * @param {boolean} [undoing] whether this takes back a change
 */
async function change(on, undoing = false) {
  try {
    update({ status: await call("PUT", "automatic", { on }), heard: Date.now() });
    const undo = { words: t("undo"), action: () => void change(!on, true) };
    tell("info", t(on ? "actions.automatic_on" : "actions.automatic_off"), undoing ? undefined : undo);
  } catch (error) {
    tellProblem(error);
    draw();
  }
}
