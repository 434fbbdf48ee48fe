/**
 * What the page knows at present. Parts of the page watch it and draw themselves anew when it changes.
 *
 * @typedef {import("./types.js").Status} Status
 *
 * @typedef {object} Known
 * @property {Status|null} status last picture from the service
 * @property {boolean} connected whether that picture is fresh
 * @property {number} heard when it came, ms
 * @property {number} retryAt when the next attempt to connect begins, ms; 0: now
 * @property {string} busy key of the words for what the service was asked and has not answered yet; "" for nothing
 * @property {string} view name of the view that is shown
 * @property {boolean} visible whether anybody can see the page
 */

/** @type {Known} */
export const known = { status: null, connected: false, heard: 0, retryAt: 0, busy: "", view: "", visible: true };

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
 * Take over what is new.
 *
 * @param {Partial<Known>} news
 */
export function update(news) {
  Object.assign(known, news);
  for (const draw of watchers) draw();
}
