/**
 * The stream of server-sent events: status, log, changes of the catalogue. Lost, it is opened again with back-off.
 */

import { call, Problem } from "./api.js";
import { known, update } from "./store.js";

/** The service sends its status at least every 2 s. */
const SILENCE_MS = 6_000;
const FIRST_DELAY_MS = 500;
const LONGEST_DELAY_MS = 8_000;

/** @typedef {import("./types.js").Event} Event */
/** @typedef {{ opened: () => void, log: (event: Event) => void, recordings: () => void }} Hearer */

/** @type {Hearer[]} */
const hearers = [];
/** @type {EventSource|null} */
let source = null;
let delayMs = FIRST_DELAY_MS;
let retry = 0;
let watchdog = 0;

/**
 * Have what else the stream brings.
 *
 * @param {Partial<Hearer>} hearer `opened`: a new stream begins, which tells the log from the beginning again.
 */
export function hear(hearer) {
  hearers.push({ opened: () => {}, log: () => {}, recordings: () => {}, ...hearer });
}

/** Open the stream, or open it anew. */
export function connect() {
  close();
  source = new EventSource("./api/events");
  source.addEventListener("status", (message) => {
    heard();
    update({ status: JSON.parse(message.data), connected: true, heard: Date.now(), retryAt: 0 });
  });
  source.addEventListener("log", (message) => hearers.forEach((hearer) => hearer.log(JSON.parse(message.data))));
  source.addEventListener("recordings", () => hearers.forEach((hearer) => hearer.recordings()));
  source.addEventListener("open", () => hearers.forEach((hearer) => hearer.opened()));
  source.addEventListener("error", lost);
  watchdog = setTimeout(lost, SILENCE_MS);
}

/** Take back a back-off that has become long, and try now. */
export function connectNow() {
  delayMs = FIRST_DELAY_MS;
  void tryAgain();
}

function heard() {
  delayMs = FIRST_DELAY_MS;
  clearTimeout(watchdog);
  watchdog = setTimeout(lost, SILENCE_MS);
}

function close() {
  clearTimeout(retry);
  clearTimeout(watchdog);
  source?.close();
  source = null;
}

function lost() {
  close();
  update({ connected: false, retryAt: Date.now() + delayMs });
  retry = setTimeout(tryAgain, delayMs);
  delayMs = Math.min(2 * delayMs, LONGEST_DELAY_MS);
}

/** An EventSource does not say why it fails, so the status is asked for first: it may be the token. */
async function tryAgain() {
  clearTimeout(retry);
  update({ retryAt: 0 });
  try {
    await call("GET", "status");
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (error.status !== 401) lost(); // with 401 the login opens, and connects when it is done
    return;
  }
  if (!known.connected) connect();
}
