/** Several recordings are chosen, and downloaded, deleted, restored or removed together. */

import { t } from "../i18n/i18n.js";
import { archiveOf, partOf } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { size } from "../shared/format.js";
import { place } from "../shared/router.js";
import { removeAll, removeForGood, restoreAll } from "./catalogue.js";

/** @typedef {import("../shared/types.js").Recording} Recording */

/** More would not fit into one address. */
const MOST_TOGETHER = 500;

/** @type {Map<string, Recording>} */
const chosen = new Map();
let choosing = false;
/** @type {() => void} */
let redraw = () => {};
/** @type {() => Recording[]} */
let shown = () => [];

/**
 * @param {() => Recording[]} all the recordings that are shown
 * @param {() => void} changed draws the list anew
 */
export function startSelection(all, changed) {
  [shown, redraw] = [all, changed];
  $("select").addEventListener("click", () => { choosing = !choosing; chosen.clear(); drawSelection(); redraw(); });
  $("select-all").addEventListener("click", () => {
    const those = shown().filter(({ state }) => state !== "recording");
    const none = those.every(({ id }) => chosen.has(id));
    for (const each of those) none ? chosen.delete(each.id) : chosen.set(each.id, each);
    drawSelection();
    redraw();
  });
  $("select-delete").addEventListener("click", () => void together(place().trash ? removeForGood : removeAll));
  $("select-restore").addEventListener("click", () => void together(restoreAll));
}

/** Choose nothing: another list is shown. */
export function endSelection() {
  choosing = false;
  chosen.clear();
  drawSelection();
}

/**
 * The box by which a recording is chosen; null while nothing is chosen, and for the one in progress.
 *
 * @param {Recording} recording
 * @param {string} name of it, for those who cannot see the row
 */
export function makeBox(recording, name) {
  if (!choosing || recording.state === "recording") return null;
  const box = make("input", { type: "checkbox", checked: chosen.has(recording.id), "aria-label": t("select.one", { who: name }) });
  box.addEventListener("change", () => {
    if (box.checked) chosen.set(recording.id, recording);
    else chosen.delete(recording.id);
    drawSelection();
  });
  return make("label", { class: "choose" }, box);
}

/** Draw the bar of what can be done with those that are chosen. */
export function drawSelection() {
  const { trash } = place();
  const those = [...chosen.values()];
  $("selection").hidden = !choosing;
  setText($("select").querySelector("span"), t(choosing ? "select.end" : "select.begin"));
  $("select").setAttribute("aria-pressed", String(choosing));
  setText($("select-count"), t("select.count", { count: those.length, size: size(those.reduce((sum, { bytes }) => sum + bytes, 0)) }));
  if (those.length > MOST_TOGETHER && !trash) setText($("select-count"), t("select.too_many", { count: those.length, most: MOST_TOGETHER }));
  for (const name of ["select-delete", "select-restore"]) $(name).disabled = !those.length;
  $("select-restore").hidden = !trash;
  $("select-download").hidden = trash;
  setText($("select-delete").querySelector("span"), t(trash ? "trash.remove" : "recording.delete"));
  const link = $("select-download");
  const possible = those.length > 0 && those.length <= MOST_TOGETHER;
  link.classList.toggle("off", !possible);
  if (!possible) link.removeAttribute("href");
  else link.href = those.length === 1 && those[0].parts.length < 2 ? partOf(those[0].id, "file") : archiveOf(those.map(({ id }) => id));
}

/** @param {(those: Recording[]) => Promise<void>} action */
async function together(action) {
  const those = [...chosen.values()];
  endSelection();
  await action(those);
}
