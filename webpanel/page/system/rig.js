/** The view of the rig: cameras, processes, and the rig file in use. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, fillList, setText } from "../shared/dom.js";
import { attempt } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";

/** @type {import("./types.js").RigView|null} */
let rig = null;

export function startRig() {
  watch(draw); // cameras and processes stand in the status, which may come after the rig file
}

export async function enterRig() {
  rig = await attempt(() => call("GET", "rig")) ?? rig;
  draw();
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
