/** Deletes and restores recordings, one or several; a deletion can be undone. Removes what is in the trash for good. */

import { t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { $ } from "../shared/dom.js";
import { size, who } from "../shared/format.js";
import { attempt, tell } from "../shared/snacks.js";

/** @typedef {import("../shared/types.js").Recording} Recording */

/** @type {Set<() => void>} */
const watchers = new Set();

/**
 * Call `reload` whenever this page has changed the catalogue.
 *
 * @param {() => void} reload
 */
export function watchCatalogue(reload) {
  watchers.add(reload);
}

/**
 * Put a recording into the trash, and offer to undo it.
 *
 * @param {Recording} recording
 * @returns {Promise<boolean>} whether that worked
 */
export async function remove(recording) {
  const gone = await change("DELETE", recording.id, "");
  if (!gone) return false;
  const words = t("recording.deleted", { who: who(recording.session, recording.id) });
  tell("info", words, { words: t("undo"), action: () => void restore(gone) });
  return true;
}

/**
 * Take a recording out of the trash.
 *
 * @param {Recording} recording
 */
export async function restore(recording) {
  const back = await change("POST", recording.id, "/restore");
  if (back) tell("good", t("recording.restored", { who: who(back.session, back.id) }));
}

/**
 * Put several recordings into the trash, and offer to undo it.
 *
 * @param {Recording[]} those
 */
export async function removeAll(those) {
  if (those.length === 1) return void await remove(those[0]);
  const gone = await changeAll("DELETE", those, "");
  if (gone.length) tell("info", t("recording.deleted_all", { count: gone.length }), { words: t("undo"), action: () => void restoreAll(gone) });
}

/**
 * Take several recordings out of the trash.
 *
 * @param {Recording[]} those
 */
export async function restoreAll(those) {
  const back = await changeAll("POST", those, "/restore");
  if (back.length) tell("good", t("recording.restored_all", { count: back.length }));
}

/**
 * Ask, then remove recordings of the trash for good.
 *
 * @param {Recording[]} those
 */
export async function removeForGood(those) {
  const bytes = those.reduce((sum, recording) => sum + recording.bytes, 0);
  if (!await confirmed(those.length, bytes)) return;
  let freed = 0;
  for (const { id } of those) {
    const gone = await attempt(() => call("DELETE", `trash/${encodeURIComponent(id)}`));
    if (!gone) break;
    freed += gone.bytes;
  }
  tell("good", t("trash.freed", { size: size(freed) }));
  changed();
}

/** Ask, then remove everything in the trash for good. */
export async function emptyTrash() {
  /** @type {import("../shared/types.js").Trash|null} */
  const there = await attempt(() => call("GET", "trash"));
  if (!there?.recordings || !await confirmed(there.recordings, there.bytes)) return;
  const gone = await attempt(() => call("DELETE", "trash"));
  if (gone) tell("good", t("trash.freed", { size: size(gone.bytes) }));
  changed();
}

/**
 * @param {number} count
 * @param {number} bytes
 * @returns {Promise<boolean>} whether that is really wanted: it cannot be undone
 */
function confirmed(count, bytes) {
  const dialog = $("confirm");
  $("confirm-text").textContent = t("trash.confirm", { count, size: size(bytes) });
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((answer) => dialog.addEventListener("close", () => answer(dialog.returnValue === "yes"), { once: true }));
}

/**
 * @param {string} method
 * @param {Recording[]} those
 * @param {string} part
 * @returns {Promise<Recording[]>} those that were changed; a message says why the next one was not
 */
async function changeAll(method, those, part) {
  const done = [];
  for (const { id } of those) {
    const recording = await attempt(() => call(method, recordingPath(id, part)));
    if (!recording) break;
    done.push(recording);
  }
  changed();
  return done;
}

/**
 * @param {string} method
 * @param {string} id
 * @param {string} part
 * @returns {Promise<Recording|null>} null: it failed, and a message says why
 */
async function change(method, id, part) {
  const recording = await attempt(() => call(method, recordingPath(id, part)));
  if (recording) changed();
  return recording;
}

function changed() {
  for (const reload of watchers) reload();
}
