/** The rig file in use. */

import { call } from "./api.js";
import { $, fillList, setText } from "./dom.js";
import { t } from "./i18n.js";
import { tellProblem } from "./snacks.js";
import { known } from "./store.js";

/** @type {import("./types.js").RigView|null} */
let rig = null;

export async function enterRig() {
  try {
    rig = await call("GET", "rig");
    draw();
  } catch (error) {
    tellProblem(error);
  }
}

export function draw() {
  if (!rig) return;
  setText($("rig-name"), rig.name);
  setText($("rig-file"), rig.toml);
  const { status } = known;
  fillList($("rig-facts"), [
    ...(status?.cameras ?? []).map((camera) => /** @type {[string, string]} */ ([camera.name, `${camera.backend} ${camera.address}`])),
    ...(status?.processes ?? []).map(({ name, pid, restarts }) => /** @type {[string, string]} */ (
      [t("rig.process", { name }), pid === null ? t("rig.not_running") : t("rig.running", { pid: String(pid), restarts })])),
    [t("rig.version"), status?.version ?? "–"],
  ]);
}
