/** What stands in place of a view until it is loaded: a word that it comes, or that it does not, and what to do. */

import { t } from "../i18n/i18n.js";
import { Problem } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";

/** How long the service is waited for, ms. */
const DEADLINE_MS = 5_000;

export function startLoading() {
  $("loading-again").addEventListener("click", () => void again());
}

/**
 * Load a view, and say so.
 *
 * @param {() => Promise<void>} load
 * @returns {Promise<boolean>} whether it is there
 */
export async function loadView(load) {
  say("loading.title", "");
  try {
    await load();
    return true;
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    // Where the service answers, it has no such file: it was started anew with another version of the page.
    say("loading.failed", await answers() ? "loading.newer" : "loading.lost");
    return false;
  }
}

/** Load the whole page anew, if there is anything to load: what is on it is better than what a browser says instead. */
async function again() {
  $("loading-again").disabled = true;
  if (await answers()) return location.reload();
  say("loading.failed", "loading.lost");
}

/** Whether the service is there. */
async function answers() {
  try {
    return (await fetch("./", { method: "HEAD", cache: "no-store", signal: AbortSignal.timeout(DEADLINE_MS) })).ok;
  } catch (error) {
    if (error instanceof TypeError || error instanceof DOMException) return false;
    throw error;
  }
}

/**
 * @param {string} title key of its words
 * @param {string} why the same; "": it is still coming
 */
function say(title, why) {
  setText($("loading-title"), t(title));
  setText($("loading-why"), why ? t(why) : "");
  $("loading-again").hidden = !why;
  $("loading-again").disabled = false;
}
