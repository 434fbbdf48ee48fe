/**
 * The connection to the service: the stream of server-sent events (status, log, changes of the list of recordings).
 * When it is lost, it is opened again after growing delays, and a banner says so.
 */

import { t } from "../i18n/i18n.js";
import { call, Problem } from "./api.js";
import { $, setText } from "./dom.js";
import { known, update, watch } from "./store.js";

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
 * Listen to what the stream brings beside the status.
 *
 * @param {Partial<Hearer>} hearer `opened`: a new stream begins, which sends the log from its beginning again.
 */
export function hear(hearer) {
  hearers.push({ opened: () => {}, log: () => {}, recordings: () => {}, ...hearer });
}

/** Open the stream; an open one is closed first. */
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

/** Try to connect now, and begin with short delays again. */
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

/** An EventSource does not say why it fails. So fetch the status first: the service may want the token. */
async function tryAgain() {
  clearTimeout(retry);
  update({ retryAt: 0 });
  try {
    await call("GET", "status");
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (error.status !== 401) lost(); // with 401 the login opens; after it the page is loaded anew
    return;
  }
  if (!known.connected) connect();
}

export function startBanner() {
  $("banner-retry").addEventListener("click", connectNow);
  watch(drawBanner);
  setInterval(drawBanner, 1000);
}

function drawBanner() {
  const lost = !known.connected && known.heard > 0 || known.retryAt > 0;
  $("banner").hidden = !lost;
  if (!lost) return;
  const seconds = Math.max(0, Math.ceil((known.retryAt - Date.now()) / 1000));
  setText($("banner-text"), t("lost.text"));
  setText($("banner-retry"), seconds ? t("lost.retry_in", { seconds }) : t("lost.trying"));
  $("banner-retry").disabled = !known.retryAt;
}
