/**
 * A tab's side of the connection to the service (hub.js): tells it what the tab wants to see, and puts what comes into
 * the store. A banner says when the connection is lost, or when only the status gets through.
 */

import { say, t } from "../i18n/i18n.js";
import { needToken } from "./api.js";
import { $, setText } from "./dom.js";
import { makeHub } from "./hub.js";
import { known, update, watch } from "./store.js";

/** A status comes at least every 2 s; one that is older than this is old. */
const FRESH_MS = 6_000;
/** The hub has news, good or bad, more often than this; if not, its worker has died. */
const SILENCE_MS = 20_000;

/** @typedef {import("./types.js").Event} Event */
/** @typedef {import("./hub.js").News} News */
/** @typedef {{ opened: () => void, log: (event: Event) => void, recordings: () => void, picture: (image: Blob, shown: () => void) => void, noPicture: (why: import("./hub.js").Why|null) => void }} Hearer */

/** So many lines of the log are kept for parts of the page that come later. */
const LINES_KEPT = 1_000;

/** @type {Hearer[]} */
const hearers = [];
/** The log since it was opened, oldest first. @type {Event[]} */
let lines = [];
/** @type {MessagePort|null} */
let port = null;
let watchdog = 0;
let freshness = 0;
/** Who wants live pictures. @type {Set<string>} */
const viewers = new Set();
let workerWorks = typeof SharedWorker !== "undefined";

/**
 * Listen to what comes beside the status. What the log has said already is heard at once.
 *
 * @param {Partial<Hearer>} hearer `opened`: the log comes from its beginning again; `picture`: call `shown` for the next one.
 */
export function hear(hearer) {
  const whole = { opened: () => {}, log: () => {}, recordings: () => {}, picture: (/** @type {Blob} */ _, /** @type {() => void} */ shown) => shown(), noPicture: () => {}, ...hearer };
  hearers.push(whole);
  lines.forEach(whole.log);
}

/** Begin to listen to the service. */
export function connect() {
  disconnect();
  port = workerWorks ? joinWorker() : joinOwn();
  port.onmessage = ({ data }) => heard(data);
  wish();
  port.postMessage({ type: "retry" });
  document.addEventListener("visibilitychange", wish);
  addEventListener("pagehide", disconnect);
  addEventListener("pageshow", resume);
}

/** Try to connect now. */
export function connectNow() {
  update({ retryAt: 0 });
  port?.postMessage({ type: "retry" });
}

/** Open the stream anew: this browser has logged out, which ends what it may see in all its tabs. */
export function renew() {
  port?.postMessage({ type: "renew" });
}

/**
 * Say whether a part of this tab shows the live picture.
 *
 * @param {string} part
 * @param {boolean} wanted
 */
export function wantPicture(part, wanted) {
  if (wanted) viewers.add(part);
  else viewers.delete(part);
  wish();
}

/** Say what this tab shows. */
function wish() {
  if (!document.hidden && Date.now() - known.heard > FRESH_MS) getOld(); // the tab or the whole device has slept
  port?.postMessage({ type: "wish", visible: !document.hidden, picture: viewers.size > 0 });
}

function joinWorker() {
  const worker = new SharedWorker(new URL("./hub-worker.js", import.meta.url), { type: "module", name: "svev" });
  worker.onerror = () => { // the browser cannot run it
    workerWorks = false;
    connect();
  };
  return worker.port;
}

function joinOwn() {
  const channel = new MessageChannel();
  makeHub(false)(channel.port1);
  return channel.port2;
}

function getOld() {
  if (known.connected) update({ connected: false, retryAt: 0 });
}

function disconnect() {
  clearTimeout(watchdog);
  port?.postMessage({ type: "bye" });
  port?.close();
  port = null;
}

/** @param {PageTransitionEvent} event */
function resume(event) {
  if (event.persisted) connect(); // back from the browser's memory of left pages
}

/** @param {News} news */
function heard(news) {
  clearTimeout(watchdog);
  watchdog = setTimeout(connect, SILENCE_MS);
  if (news.type === "status") {
    clearTimeout(freshness);
    freshness = setTimeout(getOld, FRESH_MS);
    update({ status: news.status, connected: true, heard: news.heard, retryAt: 0, slow: news.why });
  }
  if (news.type === "lost") update({ connected: false, retryAt: news.retryAt, slow: null });
  if (news.type === "login") needToken();
  if (news.type === "log") {
    lines = [...(news.fresh ? [] : lines), ...news.events].slice(-LINES_KEPT);
    if (news.fresh) hearers.forEach((hearer) => hearer.opened());
    for (const event of news.events) hearers.forEach((hearer) => hearer.log(event));
  }
  if (news.type === "recordings") hearers.forEach((hearer) => hearer.recordings());
  if (news.type === "picture") hearers.forEach((hearer) => hearer.picture(news.image, () => port?.postMessage({ type: "shown" })));
  if (news.type === "no-picture") hearers.forEach((hearer) => hearer.noPicture(news.why));
}

export function startBanner() {
  $("banner-retry").addEventListener("click", connectNow);
  watch(drawBanner);
  setInterval(drawBanner, 1000);
}

function drawBanner() {
  const lost = !known.connected && (known.heard > 0 || known.retryAt > 0);
  $("banner").hidden = !lost && !known.slow;
  if ($("banner").hidden) return;
  setText($("banner-title"), t(lost ? "lost.title" : "slow.title"));
  setText($("banner-text"), lost || !known.slow ? t("lost.text") : say(known.slow).text);
  $("banner-retry").hidden = !lost;
  const seconds = Math.max(0, Math.ceil((known.retryAt - Date.now()) / 1000));
  setText($("banner-retry"), seconds ? t("lost.retry_in", { seconds }) : t("lost.trying"));
  $("banner-retry").disabled = !known.retryAt;
}
