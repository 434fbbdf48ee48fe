/**
 * What this page knows and shows: one plain object. Parts of the page watch it, and draw themselves once a frame of the screen.
 *
 * @typedef {import("../types.js").Place} Place
 * @typedef {import("../types.js").Thing} Thing
 * @typedef {import("../types.js").PulseView} PulseView
 * @typedef {import("../views/transform.js").Lens} Lens
 *
 * @typedef {object} Tape a length between two things
 * @property {Record<string, Place>} from places by camera
 * @property {Record<string, Place>} to
 * @property {import("../types.js").Estimate|null} measured
 *
 * @typedef {object} State
 * @property {import("../types.js").Opening|null} opening
 * @property {string} operator who measures; "": not asked yet
 * @property {import("../types.js").SessionView|null} session
 * @property {PulseView|null} view of the pulse in sight; null: not there yet
 * @property {number} pulse the one in sight
 * @property {string} camera the view in which keys act, large where one is
 * @property {string} thing the one that a click places
 * @property {number|null} vertex of a line, on which keys act
 * @property {string} group of the things that are listed and gone through
 * @property {import("./advance.js").Advance} advance
 * @property {boolean} guess whether what is placed is a guess
 * @property {boolean} large whether one view is large and the others small
 * @property {boolean} linked whether all views zoom and move together
 * @property {boolean} ghost whether the marks of the pulse before are shown
 * @property {boolean} difference whether the difference to the background is shown
 * @property {number} loupe how many times it enlarges; 0: there is none
 * @property {import("../views/tone.js").Tone} tone
 * @property {Record<string, Lens>} lenses by camera; none: the whole image
 * @property {{ camera: string, xy: Place, finger: boolean, pointer: boolean }|null} hover where the pointer is, or the crosshair of the keys
 * @property {{ camera: string, thing: string, vertex: number|null, xy: Place }|null} dragged
 * @property {{ camera: string, geometry: import("../types.js").Geometry }|null} live what the place of the pointer means
 * @property {Record<string, Record<string, import("../types.js").Curve>>} curves of the marks of the thing: by camera of the mark, then of the curve
 * @property {{ thing: string, pulse: number }|null} drawn the line that was drawn last, which is to be found in all images
 * @property {Tape|null} tape
 * @property {boolean} playing
 * @property {string} busy what the service is doing for long: key of the words; "": nothing
 * @property {boolean} cut whether the service does not answer
 */

import { load, save } from "../../shared/store.js";

/** Pictures as they were recorded. @type {import("../views/tone.js").Tone} */
export const PLAIN = { brightness: 0, contrast: 1, gamma: 1 };
/** What is remembered between visits. */
const KEPT = /** @type {const} */ (["advance", "large", "linked", "ghost", "loupe"]);

/** @type {State} */
export const state = {
  opening: null, operator: "", session: null, view: null, pulse: 0, camera: "", thing: "", vertex: null, group: "jumper",
  advance: "point", guess: false, large: matchMedia("(max-width: 1599px)").matches, linked: false, ghost: true, difference: false, loupe: 8,
  tone: PLAIN, lenses: {}, hover: null, dragged: null, live: null, curves: {}, drawn: null, tape: null, playing: false, busy: "", cut: false,
  ...load("digitize", {}),
};

/** @type {(() => void)[]} */
const watchers = [];
let drawing = false;

/**
 * Call `draw` soon, and after each change.
 *
 * @param {() => void} draw
 */
export function watch(draw) {
  watchers.push(draw);
  redraw();
}

/** Draw all parts with the next frame of the screen. */
export function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    for (const draw of watchers) draw();
  });
}

/**
 * Change what is known, and draw it.
 *
 * @param {Partial<State>} news
 */
export function change(news) {
  Object.assign(state, news);
  if (KEPT.some((name) => name in news)) save("digitize", Object.fromEntries(KEPT.map((name) => [name, state[name]])));
  redraw();
}

/** A phone, upright or held across: beside each other pictures would be too small to measure in. */
const PHONE = matchMedia("(max-width: 599px), (max-width: 1199px) and (max-height: 500px)");
PHONE.addEventListener("change", redraw);

/** Whether this screen has room for large pictures side by side. */
export function canBeSideBySide() {
  return !PHONE.matches;
}

/** Whether one view is large and the others are small. */
export function oneIsLarge() {
  return cameras().length > 1 && (state.large || PHONE.matches);
}

/** Names of the cameras, from left to right. */
export function cameras() {
  return state.opening?.cameras.map(({ name }) => name) ?? [];
}

/**
 * The thing of this name.
 *
 * @param {string} [name] the one that a click places
 * @returns {Thing|null}
 */
export function thingOf(name = state.thing) {
  return state.opening?.things.find((thing) => thing.name === name) ?? null;
}

/** The things of the group that is listed. */
export function listed() {
  return state.opening?.things.filter(({ group }) => group === state.group) ?? [];
}

/**
 * What became of a frame: o ok, l lost, m missed, d damaged, a absent.
 *
 * @param {string} camera
 * @param {number} [pulse]
 */
export function fate(camera, pulse = state.pulse) {
  return state.opening?.status[camera]?.[indexOf(pulse)] ?? "a";
}

/** @param {number} pulse @returns {number} its place among the pulses of the log; -1: it is none of them */
export function indexOf(pulse) {
  const pulses = state.opening?.pulses ?? [];
  const at = pulse - pulses[0]; // without a gap in the numbers, which is the rule
  return pulses[at] === pulse ? at : pulses.indexOf(pulse);
}

/** Words for the letters of `fate`. @type {Record<string, string>} */
export const FATES = { o: "status.ok", l: "status.lost", m: "status.missed", d: "status.damaged", a: "status.absent" };
