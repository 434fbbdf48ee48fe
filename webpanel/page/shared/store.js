/**
 * What the page knows at present: parts of the page watch it, and draw themselves anew when it changes. And what the
 * browser remembers between visits: look and language, nothing secret.
 *
 * @typedef {import("./types.js").Status} Status
 *
 * @typedef {object} Known
 * @property {Status|null} status the last one from the service
 * @property {boolean} connected whether that status is fresh
 * @property {number} heard when that status came, ms
 * @property {number} retryAt when the next attempt to connect begins, ms; 0: now
 * @property {{ code: string, text: string }|null} slow why the status is asked for instead of told at once; null: it is told
 * @property {string} busy key of the words for the call that the service has not answered yet; "": there is none
 * @property {string} role what this browser may do: "watch", "operate", "administer"; "": not known yet
 * @property {string} view name of the view that is shown
 * @property {boolean} visible whether anybody can see the page
 */

/** @type {Known} */
export const known = { status: null, connected: false, heard: 0, retryAt: 0, slow: null, busy: "", role: "", view: "", visible: true };

/** @type {Set<() => void>} */
const watchers = new Set();

/**
 * Call `draw` now and whenever something has changed.
 *
 * @param {() => void} draw
 */
export function watch(draw) {
  watchers.add(draw);
  draw();
}

/**
 * Change what is known, and redraw.
 *
 * @param {Partial<Known>} news
 */
export function update(news) {
  Object.assign(known, news);
  for (const draw of watchers) draw();
}

const PREFIX = "svev.";

/**
 * What is remembered under a name.
 *
 * @template T
 * @param {string} name
 * @param {T} otherwise returned if nothing (or nothing readable) is remembered
 * @returns {T}
 */
export function load(name, otherwise) {
  try {
    const text = localStorage.getItem(PREFIX + name);
    return text === null ? otherwise : JSON.parse(text);
  } catch {
    return otherwise; // storage is switched off, or was written by another version: begin anew
  }
}

/**
 * Remember a value under a name.
 *
 * @param {string} name
 * @param {unknown} value
 */
export function save(name, value) {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch {
    console.warn(`"${name}" cannot be remembered: this browser's storage is full or switched off`);
  }
}
