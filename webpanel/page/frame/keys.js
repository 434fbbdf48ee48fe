/** The keyboard: one table of what each key does and what the help says about it. */

import { t } from "../i18n/i18n.js";
import { $, make } from "../shared/dom.js";
import { go } from "../shared/router.js";
import { clearSnacks } from "../shared/snacks.js";
import { known, load, save } from "../shared/store.js";
import { openSettings } from "./settings.js";

const DIGITS = ["0", "1", "2", "3", "4", "5", "6", "7", "8"];

/** @typedef {{ keys: string[], words: string, action?: (event: KeyboardEvent) => void, view?: string }} Key `view`: the one whose part knows what they do */

/** @type {Key[]} */
const KEYS = [
  { keys: ["r"], words: "keys.next_step", view: "live" },
  { keys: ["s"], words: "keys.save_last", view: "live" },
  { keys: ["n"], words: "keys.next_jumper", view: "live" },
  { keys: ["x"], words: "keys.disarm", view: "live" },
  { keys: DIGITS, words: "keys.camera", view: "live" },
  { keys: ["v"], words: "keys.live", action: () => go("live") },
  { keys: ["j"], words: "keys.recordings", action: () => go("recordings") },
  { keys: ["l"], words: "keys.log", action: () => go("log") },
  { keys: ["c"], words: "keys.doctor", action: () => go("doctor") },
  { keys: ["i"], words: "keys.rig", action: () => go("rig") },
  { keys: ["ArrowLeft", "ArrowRight"], words: "keys.frame", view: "recording" },
  { keys: ["Home", "End"], words: "keys.ends", view: "recording" },
  { keys: [" "], words: "keys.play", view: "recording" },
  { keys: ["g"], words: "keys.gap", view: "recording" },
  { keys: ["t"], words: "keys.moment", view: "recording" },
  { keys: ["o"], words: "keys.loop", view: "recording" },
  { keys: ["-", "+"], words: "keys.speed", view: "recording" },
  { keys: ["m"], words: "keys.note", view: "recording" },
  { keys: DIGITS, words: "keys.camera", view: "recording" },
  { keys: ["Delete"], words: "keys.delete", view: "recording" },
  { keys: ["Escape"], words: "keys.escape", action: escape },
  { keys: ["?"], words: "keys.help", action: openSettings },
];

/** @type {() => Record<string, (event: KeyboardEvent) => void>} */
let actionsHere = () => ({});

/** How the help writes keys whose name is not what they print. */
const CAPS = /** @type {Record<string, string>} */ ({ ArrowLeft: "←", ArrowRight: "→", " ": "keys.cap_space" });

/**
 * @param {() => Record<string, (event: KeyboardEvent) => void>} actions what keys do in the view that is shown, by the key of
 *   their words
 */
export function startKeys(actions) {
  actionsHere = actions;
  addEventListener("keydown", pressed);
  drawKeys();
  $("keys-on").checked = load("keys", true);
  $("keys-on").addEventListener("change", () => save("keys", $("keys-on").checked));
}

/** Draw the list of keys in the settings dialog. */
export function drawKeys() {
  $("keys-list").replaceChildren(...KEYS.filter((key, index) => KEYS.findIndex(({ words }) => words === key.words) === index).map((key) => {
    const shown = key.keys === DIGITS ? [DIGITS[0], "1", "2", "…"] : key.keys;
    return make("div", {}, make("dt", {}, ...shown.map((name) => make("kbd", {}, CAPS[name]?.startsWith("keys.") ? t(CAPS[name]) : CAPS[name] ?? name))), make("dd", {}, t(key.words)));
  }));
}

/** @param {KeyboardEvent} event */
function pressed(event) {
  const on = /** @type {Element} */ (event.target);
  if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing || document.querySelector("dialog[open]")) return;
  if (on.matches("textarea, select, input:not([type=range])")) {
    if (event.key === "Escape") /** @type {HTMLElement} */ (on).blur();
    return;
  }
  if (!$("keys-on").checked && !["?", "Escape", "ArrowLeft", "ArrowRight"].includes(event.key)) return;
  if (event.key === " " && on.matches("button, a")) return; // the key presses that button
  const key = KEYS.find(({ keys, view }) => keys.includes(event.key) && (!view || view === known.view));
  const action = key && (key.action ?? actionsHere()[key.words]);
  if (!action || event.repeat && !event.key.startsWith("Arrow")) return;
  event.preventDefault();
  action(event);
}

/** @param {KeyboardEvent} event */
function escape(event) {
  clearSnacks();
  actionsHere()["keys.escape"]?.(event);
}
