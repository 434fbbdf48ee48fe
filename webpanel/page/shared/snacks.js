/** Messages at the lower edge of the page, some with a button to undo. Errors stay until they are closed. */

import { say, t } from "../i18n/i18n.js";
import { Problem } from "./api.js";
import { $, icon, make } from "./dom.js";

const SHOWN_MS = 10_000;

/**
 * @typedef {object} Offer a button in the message
 * @property {string} words
 * @property {() => void} action
 */

/**
 * Show a message for a while.
 *
 * @param {import("./types.js").Level} level
 * @param {string} text
 * @param {Offer} [offer]
 * @returns {() => void} removes it
 */
export function tell(level, text, offer) {
  const snack = make("div", { class: "snack", "data-level": level, role: level === "error" ? "alert" : "status" },
    icon(level), make("p", {}, text));
  const remove = () => snack.remove();
  if (offer) {
    snack.append(make("button", { type: "button", onclick: () => { remove(); offer.action(); } }, offer.words));
  }
  snack.append(make("button", { type: "button", class: "plain square", "aria-label": t("close"), onclick: remove }, icon("close")));
  const all = $("snacks");
  if (level === "error") all.querySelectorAll('[data-level="error"]').forEach((/** @type {Element} */ old) => old.remove());
  all.append(snack);
  if (level !== "error") setTimeout(remove, SHOWN_MS);
  return remove;
}

/**
 * Show what went wrong and what to do.
 *
 * @param {unknown} error
 */
export function tellProblem(error) {
  if (!(error instanceof Problem)) throw error;
  if (error.status === 401) return; // the login opens
  tell("error", say(error.said).text);
}

/**
 * Do something that may fail; if it does, show what went wrong.
 *
 * @template T
 * @param {() => Promise<T>} action
 * @returns {Promise<T|null>} null: it failed
 */
export async function attempt(action) {
  try {
    return await action();
  } catch (error) {
    tellProblem(error);
    return null;
  }
}

/** Remove all messages. */
export function clearSnacks() {
  $("snacks").replaceChildren();
}
