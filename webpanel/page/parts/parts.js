/**
 * The parts of the page: what is behind each view. Modules, looks and words of a part are loaded when one of its views is
 * shown for the first time.
 */

import { needWords } from "../i18n/i18n.js";
import { make } from "../shared/dom.js";
import { bring, missing } from "../shared/loading.js";

/** @typedef {Record<string, (event: KeyboardEvent) => void>} Actions what keys do, by the key of their words */

/**
 * @typedef {object} Part
 * @property {() => void} start called once
 * @property {() => void} [draw] draws anew in another language what does not watch the store
 * @property {(place: import("../shared/router.js").Place) => void} [enter] one of its views is shown, or another of its kind
 * @property {() => void} [leave] that is left; called while it is still shown
 * @property {() => Actions} [keys] what keys do in it at present
 */

/** @typedef {{ views: string[], module: () => Promise<Part>, styles: string[], words: string[] }} Makings */

/** @type {Makings[]} */
const PARTS = [
  {
    views: ["live"], module: () => import("./live.js"), words: ["live", "startlist", "jump", "measuring"],
    styles: ["live/live", "live/listload", "recordings/recordings", "jump/jump"],
  },
  {
    views: ["recordings"], module: () => import("./recordings.js"), words: ["recordings"],
    styles: ["recordings/recordings"],
  },
  {
    views: ["recording"], module: () => import("./recording.js"), words: ["recording", "viewing", "kinogram", "measuring", "jump"],
    styles: ["live/live", "recordings/recordings", "recordings/kinogram", "viewing/viewing", "jump/jump"],
  },
  {
    views: ["athlete", "jumps"], module: () => import("./athletes.js"), words: ["athletes", "measuring"],
    styles: ["recordings/recordings", "athletes/athletes"],
  },
  {
    views: ["log"], module: () => import("./log.js"), words: ["log"],
    styles: ["system/system"],
  },
  {
    views: ["doctor"], module: () => import("./check.js"), words: ["check"],
    styles: ["live/live", "recordings/recordings", "system/system"],
  },
  {
    views: ["aim"], module: () => import("./aim.js"), words: ["check", "calibrating"],
    styles: ["live/live", "recordings/recordings", "system/system", "system/calibrating"],
  },
  {
    views: ["rig"], module: () => import("./rig.js"), words: [],
    styles: ["system/system"],
  },
  {
    views: ["coach"], module: () => import("./coach.js"), words: ["jump", "measuring"],
    styles: ["live/live", "jump/jump"],
  },
  {
    views: ["jump"], module: () => import("./visit.js"), words: ["jump", "measuring"],
    styles: ["live/live", "recordings/recordings", "jump/jump"],
  },
];

/** All of them, each after those that it changes. */
const STYLES = ["live/live", "live/listload", "recordings/recordings", "recordings/kinogram", "viewing/viewing", "athletes/athletes", "system/system", "system/calibrating", "jump/jump"];

/** Those that have been started. @type {Map<Makings, Part>} */
const started = new Map();

/**
 * The part behind a view; null: it is not loaded yet.
 *
 * @param {string} view
 */
export function partOf(view) {
  return started.get(makingsOf(view)) ?? null;
}

/** All parts that are loaded. */
export function loadedParts() {
  return [...started.values()];
}

/**
 * Load what is behind a view.
 *
 * @param {string} view
 * @throws {import("../shared/api.js").Problem} something of it does not come
 */
export async function loadPart(view) {
  const makings = makingsOf(view);
  const [part] = await Promise.all([bring(makings.module), needWords(...makings.words), ...makings.styles.map(addStyle)]);
  if (started.has(makings)) return; // it was wanted twice meanwhile
  part.start();
  started.set(makings, part);
}

/** @param {string} view */
function makingsOf(view) {
  const found = PARTS.find(({ views }) => views.includes(view));
  if (!found) throw new Error(`there is no part behind the view "${view}"`);
  return found;
}

/**
 * Take a style sheet up, once, before those that change it.
 *
 * @param {string} style
 * @returns {Promise<void>} when it is there
 */
function addStyle(style) {
  const links = /** @type {HTMLLinkElement[]} */ ([...document.head.querySelectorAll("link[data-style]")]);
  const found = links.find((link) => link.dataset.style === style);
  if (found?.sheet) return Promise.resolve();
  const link = found ?? make("link", { rel: "stylesheet", "data-style": style, href: new URL(`../${style}.css`, import.meta.url).href });
  return new Promise((resolve, reject) => {
    link.addEventListener("load", () => resolve());
    link.addEventListener("error", () => { link.remove(); reject(missing()); });
    const next = links.find((other) => STYLES.indexOf(other.dataset.style ?? "") > STYLES.indexOf(style));
    if (!found) document.head.insertBefore(link, next ?? null);
  });
}
