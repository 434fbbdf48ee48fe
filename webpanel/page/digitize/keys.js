/** The keyboard: one table of what each key does and what the help says about it. The left hand reaches all that is used often. */

import { chooseLanguage, languageInUse, t } from "../i18n/i18n.js";
import { $, make } from "../shared/dom.js";
import { clearSnacks } from "../shared/snacks.js";
import { load, save } from "../shared/store.js";
import { stepPulse, toEnd, toGap, togglePlay, toNext, toOpen, toWorst } from "./cards/pulses.js";
import { follow, refineHere, toEndOfRun } from "./cards/tracking.js";
import { accept, BY_HAND, nudge, remove, setSigma, setState, stepCamera, stepThing, target, toggleGuess } from "./marking/marking.js";
import { toggleTape } from "./marking/tape.js";
import { takeBack } from "./session/session.js";
import { change, state } from "./session/state.js";
import { centre, moveCrosshair, pan, placeAtCrosshair, showWhole, zoomIn, zoomOut } from "./views/panes.js";
import { spreadTone } from "./views/picture.js";

/** A nudge, and one with the Shift key, px of the image. */
const [NUDGE, LARGE_NUDGE] = [0.1, 1];
/** A step of the crosshair, and one with the Shift key, CSS px. */
const [STEP, SMALL_STEP] = [12, 1];
const SIGMA_STEP = 1.25;
const LOUPES = [0, 8, 16, 32];

/** @typedef {{ keys: string[], words: string, action: (event: KeyboardEvent) => void }} Key keys as `event.key` says them, in lower case */

/** @param {string} plus @param {(sign: 1|-1, event: KeyboardEvent) => void} action @returns {(event: KeyboardEvent) => void} */
const either = (plus, action) => (event) => action(event.key.toLowerCase() === plus ? 1 : -1, event);
/** @type {Record<string, [number, number]>} */
const WAYS = { arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, -1], arrowdown: [0, 1], j: [-1, 0], l: [1, 0], i: [0, -1], k: [0, 1] };

/** @type {Key[]} */
const KEYS = [
  { keys: ["q", "w"], words: "digitize.key_step", action: either("w", (sign, event) => stepPulse(sign * (event.shiftKey ? 10 : 1))) },
  { keys: ["a", "s"], words: "digitize.key_thing", action: either("s", stepThing) },
  { keys: ["d"], words: "digitize.key_camera", action: (event) => stepCamera(event.shiftKey ? -1 : 1) },
  { keys: ["e"], words: "digitize.key_refine", action: () => void refineHere() },
  { keys: ["r"], words: "digitize.key_accept", action: (event) => void accept(event.shiftKey) },
  { keys: ["z"], words: "digitize.key_undo", action: (event) => void takeBack(event.shiftKey ? "redo" : "undo") },
  { keys: ["x", "delete"], words: "digitize.key_remove", action: remove },
  { keys: ["c"], words: "digitize.key_hidden", action: () => setState("hidden") },
  { keys: ["v"], words: "digitize.key_not_visible", action: () => setState("not visible") },
  { keys: ["b"], words: "digitize.key_guess", action: toggleGuess },
  { keys: ["f"], words: "digitize.key_next", action: () => void toNext() },
  { keys: ["t"], words: "digitize.key_open", action: toOpen },
  { keys: ["g"], words: "digitize.key_gap", action: toGap },
  { keys: ["5"], words: "digitize.key_worst", action: () => void toWorst() },
  { keys: ["1", "2"], words: "digitize.key_track", action: either("2", (sign) => void follow(sign)) },
  { keys: ["3"], words: "digitize.key_end", action: toEndOfRun },
  { keys: ["4"], words: "digitize.key_centre", action: centre },
  { keys: ["arrowleft", "arrowright", "arrowup", "arrowdown"], words: "digitize.key_nudge", action: arrow },
  { keys: ["i", "j", "k", "l"], words: "digitize.key_crosshair", action: (event) => { const [x, y] = WAYS[event.key.toLowerCase()]; const step = event.shiftKey ? SMALL_STEP : STEP; moveCrosshair(x * step, y * step); } },
  { keys: ["enter"], words: "digitize.key_place", action: placeAtCrosshair },
  { keys: [",", "."], words: "digitize.key_sigma", action: either(".", (sign) => setSigma((target()?.sigma?.[0] ?? BY_HAND) * SIGMA_STEP ** sign)) },
  { keys: ["+", "-"], words: "digitize.key_zoom", action: (event) => { if (event.key === "+") zoomIn(); else zoomOut(); } },
  { keys: ["0"], words: "digitize.key_whole", action: showWhole },
  { keys: ["m"], words: "digitize.key_large", action: () => change({ large: !state.large }) },
  { keys: ["u"], words: "digitize.key_loupe", action: () => change({ loupe: LOUPES[(LOUPES.indexOf(state.loupe) + 1) % LOUPES.length] }) },
  { keys: ["o"], words: "digitize.key_ghost", action: () => change({ ghost: !state.ghost }) },
  { keys: ["y"], words: "digitize.key_difference", action: () => change({ difference: !state.difference }) },
  { keys: ["h"], words: "digitize.key_tone", action: spreadTone },
  { keys: ["n"], words: "digitize.key_tape", action: toggleTape },
  { keys: ["p"], words: "digitize.key_play", action: togglePlay },
  { keys: ["home", "end"], words: "digitize.key_ends", action: (event) => toEnd(event.key === "End") },
  { keys: ["escape"], words: "digitize.key_escape", action: escape },
  { keys: ["?"], words: "digitize.key_help", action: openHelp },
];
/** How the help writes keys whose name is not what they print. @type {Record<string, string>} */
const CAPS = { arrowleft: "←", arrowright: "→", arrowup: "↑", arrowdown: "↓", enter: "⏎", delete: "Del", escape: "Esc", home: "Home", end: "End" };
/** Keys that act again while they are held. */
const REPEATED = ["q", "w", "a", "s", "i", "j", "k", "l", ",", ".", "+", "-", "z"];

/** @param {() => void} redrawAll draws every part in the new language */
export function startKeys(redrawAll) {
  addEventListener("keydown", pressed);
  $("help-open").addEventListener("click", openHelp);
  $("help-close").addEventListener("click", () => $("help").close());
  $("language").addEventListener("change", () => { chooseLanguage($("language").value); redrawAll(); drawKeys(); });
  $("look").addEventListener("change", () => { save("look", $("look").value); setLook(); });
  setLook();
}

/** The look chosen last, here or in the panel. */
function setLook() {
  document.documentElement.dataset.look = load("look", "auto");
}

function openHelp() {
  $("language").value = languageInUse();
  $("look").value = load("look", "auto");
  drawKeys();
  $("help").showModal();
}

function drawKeys() {
  $("keys-list").replaceChildren(...KEYS.map(({ keys, words }) => make("div", {},
    make("dt", {}, ...keys.map((key) => make("kbd", {}, CAPS[key] ?? key.toUpperCase()))), make("dd", {}, t(words)))));
}

function escape() {
  clearSnacks();
  change({ tape: null, hover: null, guess: false, dragged: null });
}

/**
 * Nudge the mark, or move the picture: with Ctrl, and where nothing is marked. Nothing before the pulse's marks have come.
 *
 * @param {KeyboardEvent} event
 */
function arrow(event) {
  const [x, y] = WAYS[event.key.toLowerCase()];
  const step = event.shiftKey ? LARGE_NUDGE : NUDGE;
  if (event.ctrlKey) return pan(x, y);
  if (state.operator && !state.view) return;
  if (!nudge(x * step, y * step)) pan(x, y);
}

/** @param {KeyboardEvent} event */
function pressed(event) {
  const on = /** @type {Element} */ (event.target);
  const name = event.key.toLowerCase();
  if (event.altKey || event.metaKey || event.isComposing || document.querySelector("dialog[open]")) return;
  if (on.matches("textarea, select, input:not([type=range], [type=checkbox])")) {
    if (event.key === "Escape") /** @type {HTMLElement} */ (on).blur();
    return;
  }
  if (event.ctrlKey && !name.startsWith("arrow")) {
    if (name === "z" || name === "y") {
      event.preventDefault();
      void takeBack(name === "y" || event.shiftKey ? "redo" : "undo");
    }
    return;
  }
  if (on.matches("input[type=range]") && /^(arrow|home|end)/.test(name)) return; // they move the slider
  if (name === "enter" && on.matches("button, a, summary")) return; // the key presses that button
  if (name === " " && on.matches("canvas")) return event.preventDefault(); // held for moving the picture: the page stays
  const key = KEYS.find(({ keys }) => keys.includes(name));
  if (!key || event.repeat && !name.startsWith("arrow") && !REPEATED.includes(name)) return;
  event.preventDefault();
  key.action(event);
}
