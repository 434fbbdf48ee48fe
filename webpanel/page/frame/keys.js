/** The keyboard: one table of what each key does and what the help says about it. */

import { t } from "../i18n/i18n.js";
import { disarm, nextStep, saveLast } from "../live/actions.js";
import { showCamera, shownCamera } from "../live/preview.js";
import { nextJumper } from "../live/session.js";
import { deleteShown } from "../recordings/recording.js";
import { $, make } from "../shared/dom.js";
import { go } from "../shared/router.js";
import { clearSnacks } from "../shared/snacks.js";
import { known, load, save } from "../shared/store.js";
import { beginNote } from "../viewing/notes.js";
import { canScrub, chooseCamera, nextGap, playerInUse, step, toEnd, toMoment, togglePlay } from "../viewing/scrubber.js";
import { openSettings } from "./settings.js";

const STEP = 10;
const DIGITS = ["0", "1", "2", "3", "4", "5", "6", "7", "8"];

/** @typedef {{ keys: string[], words: string, action: (event: KeyboardEvent) => void, view?: string }} Key */

/** @type {Key[]} */
const KEYS = [
  { keys: ["r"], words: "keys.next_step", action: nextStep, view: "live" },
  { keys: ["s"], words: "keys.save_last", action: saveLast, view: "live" },
  { keys: ["n"], words: "keys.next_jumper", action: nextJumper, view: "live" },
  { keys: ["x"], words: "keys.disarm", action: disarm, view: "live" },
  { keys: DIGITS, words: "keys.camera", action: (event) => camera(Number(event.key)), view: "live" },
  { keys: ["v"], words: "keys.live", action: () => go("live") },
  { keys: ["j"], words: "keys.recordings", action: () => go("recordings") },
  { keys: ["l"], words: "keys.log", action: () => go("log") },
  { keys: ["c"], words: "keys.doctor", action: () => go("doctor") },
  { keys: ["i"], words: "keys.rig", action: () => go("rig") },
  { keys: ["ArrowLeft", "ArrowRight"], words: "keys.frame", action: (event) => step((event.key === "ArrowLeft" ? -1 : 1) * (event.shiftKey ? STEP : 1)), view: "recording" },
  { keys: ["Home", "End"], words: "keys.ends", action: (event) => toEnd(event.key === "End"), view: "recording" },
  { keys: [" "], words: "keys.play", action: togglePlay, view: "recording" },
  { keys: ["g"], words: "keys.gap", action: () => nextGap(1), view: "recording" },
  { keys: ["t"], words: "keys.moment", action: toMoment, view: "recording" },
  { keys: ["o"], words: "keys.loop", action: () => playerInUse().toggleLoop(), view: "recording" },
  { keys: ["-", "+"], words: "keys.speed", action: (event) => playerInUse().changeSpeed(event.key === "-" ? 1 : -1), view: "recording" },
  { keys: ["m"], words: "keys.note", action: beginNote, view: "recording" },
  { keys: DIGITS, words: "keys.camera", action: (event) => chooseCamera(Number(event.key) ? Number(event.key) - 1 : null), view: "recording" },
  { keys: ["Delete"], words: "keys.delete", action: () => { if (known.role === "administer") void deleteShown(); }, view: "recording" },
  { keys: ["Escape"], words: "keys.escape", action: escape },
  { keys: ["?"], words: "keys.help", action: openSettings },
];

/** How the help writes keys whose name is not what they print. */
const CAPS = /** @type {Record<string, string>} */ ({ ArrowLeft: "←", ArrowRight: "→", " ": "keys.cap_space" });

export function startKeys() {
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
  if (!key || event.repeat && !event.key.startsWith("Arrow") || key.view === "recording" && !canScrub() && key.words !== "keys.delete") return;
  event.preventDefault();
  key.action(event);
}

/** @param {number} digit 0: all */
function camera(digit) {
  const index = digit - 1;
  showCamera(digit === 0 || index === shownCamera() ? null : index);
}

function escape() {
  clearSnacks();
  if (known.view === "recording") go("recordings");
  if (known.view === "live") showCamera(null);
}
