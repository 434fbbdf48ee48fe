/** Changes of recordings, each with a way back. */

import { call } from "./api.js";
import { who } from "./format.js";
import { t } from "./i18n.js";
import { tell, tellProblem } from "./snacks.js";

/** @typedef {import("./types.js").Recording} Recording */

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

/** Somebody changed the catalogue. */
export function catalogueChanged() {
  for (const reload of watchers) reload();
}

/**
 * Into the trash, with undo.
 *
 * @param {Recording} recording
 * @returns {Promise<boolean>} whether it is there
 */
export async function remove(recording) {
  const gone = await change("DELETE", recording.id, "");
  if (!gone) return false;
  const words = t("recording.deleted", { who: who(recording.session, recording.id) });
  tell("info", words, { words: t("undo"), action: () => void restore(gone) });
  return true;
}

/**
 * Out of the trash.
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
 * @returns {Promise<Recording|null>} null: it failed, and the reason is shown
 */
async function change(method, id, part) {
  try {
    const recording = await call(method, `recordings/${encodeURIComponent(id)}${part}`);
    catalogueChanged();
    return recording;
  } catch (error) {
    tellProblem(error);
    return null;
  }
}
