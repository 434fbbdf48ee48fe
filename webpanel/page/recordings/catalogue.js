/** Deletes and restores recordings. A deletion can be undone. */

import { t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { who } from "../shared/format.js";
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
 * @param {string} method
 * @param {string} id
 * @param {string} part
 * @returns {Promise<Recording|null>} null: it failed, and a message says why
 */
async function change(method, id, part) {
  const recording = await attempt(() => call(method, recordingPath(id, part)));
  if (recording) for (const reload of watchers) reload();
  return recording;
}
