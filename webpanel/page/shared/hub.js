/**
 * The one connection of a browser to the service, shared by all its tabs: the stream of events, and live pictures while
 * a tab shows them. Browsers open six connections to a host, no more; streams of each tab would leave none for commands.
 *
 * It runs in a shared worker (hub-worker.js) or, where browsers have none, in the tab itself; then hidden tabs give
 * their connections back. While the stream is broken, the status is asked for instead.
 *
 * @typedef {import("./types.js").Status} Status
 * @typedef {import("./types.js").Event} Event
 * @typedef {{ code: string, text: string }} Why
 *
 * @typedef {{ type: "wish", visible: boolean, picture: boolean } | { type: "shown" | "retry" | "renew" | "bye" }} Request
 *   What a tab says; "shown": the last picture; "renew": this browser has logged out.
 *
 * @typedef {{ type: "status", status: Status, heard: number, why: Why|null }} StatusNews `why`: the stream is broken, so
 *   the status was asked for.
 * @typedef {{ type: "lost", retryAt: number }} LostNews
 * @typedef {{ type: "log", fresh: boolean, events: Event[] }} LogNews `fresh`: from the beginning again.
 * @typedef {{ type: "picture", image: Blob } | { type: "no-picture", why: Why|null }} PictureNews
 * @typedef {StatusNews | LostNews | LogNews | PictureNews | { type: "login" | "recordings" }} News What a tab hears.
 */

import { API, asProblem, call, Problem } from "./api.js";

/** The service sends its status at least every 2 s. */
const SILENCE_MS = 6_000;
const FIRST_MS = 3_000;
const ASK_EVERY_MS = 2_000;
const FIRST_DELAY_MS = 500;
const LONGEST_DELAY_MS = 8_000;
/** Pause after a picture was refused or did not come. */
const PICTURE_RETRY_MS = 2_000;
const PICTURE_DEADLINE_MS = 20_000;
/** The service keeps as many events. */
const EVENTS_KEPT = 1_000;

const ASK_DEADLINE_MS = 3_000;
const UNWANTED = "unwanted";

/** @typedef {{ port: MessagePort, visible: boolean, picture: boolean, ready: boolean }} Tab */

/**
 * @param {boolean} evenHidden keep the stream also while no tab is visible
 * @returns {(port: MessagePort) => void} takes another tab up
 */
export function makeHub(evenHidden) {
  /** @type {Set<Tab>} */
  const tabs = new Set();
  /** @type {Event[]} */
  let events = [];
  /** @type {StatusNews|LostNews|null} */
  let last = null;
  let following = false;
  let looking = false;
  /** Of the picture that was fetched last; "0": some tab has none yet. */
  let pulse = "0";
  /** Ends the stream that is open. */
  let stream = new AbortController();
  let wake = () => {};
  let delayMs = FIRST_DELAY_MS;

  const wanted = () => [...tabs].some((tab) => evenHidden || tab.visible);
  const viewers = () => [...tabs].filter((tab) => tab.visible && tab.picture && tab.ready);

  /** @param {News} news */
  function tell(news) {
    if (news.type === "status" || news.type === "lost") last = news;
    for (const { port } of tabs) port.postMessage(news);
  }

  /** @param {number} ms */
  function pause(ms) {
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, ms);
      wake = () => { clearTimeout(timer); resolve(undefined); };
    });
  }

  /** Keep the stream open while it is wanted. */
  async function follow() {
    if (following) return;
    following = true;
    while (wanted()) {
      stream = new AbortController();
      const why = await read(stream);
      if (!why) continue;
      if (why.status === 401) tell({ type: "login" });
      else if (await ask(why)) delayMs = ASK_EVERY_MS;
      else tell({ type: "lost", retryAt: Date.now() + delayMs });
      await pause(why.status === 401 ? 2 ** 31 - 1 : delayMs); // after a login the page is loaded anew
      delayMs = Math.min(2 * delayMs, LONGEST_DELAY_MS);
    }
    last = null;
    following = false;
  }

  /**
   * Read one stream to its end.
   *
   * @param {AbortController} ending
   * @returns {Promise<Problem|null>} why it has ended; null: nobody wanted it any more
   */
  async function read(ending) {
    let watchdog = setTimeout(() => ending.abort(), FIRST_MS);
    let fresh = true;
    try {
      const answer = await fetch(`${API}events`, { cache: "no-store", signal: ending.signal });
      if (!answer.ok || !answer.body) return await asProblem(answer);
      await readEvents(answer.body, (messages) => {
        clearTimeout(watchdog);
        watchdog = setTimeout(() => ending.abort(), SILENCE_MS);
        delayMs = FIRST_DELAY_MS;
        const news = messages.filter(({ event }) => event === "log").map(({ data }) => JSON.parse(data));
        if (fresh) events = [];
        events = [...events, ...news].slice(-EVENTS_KEPT);
        if (fresh || news.length) tell({ type: "log", fresh, events: news });
        const status = messages.findLast(({ event }) => event === "status");
        if (status) tell({ type: "status", status: JSON.parse(status.data), heard: Date.now(), why: null });
        // A change from before the stream was opened is told to nobody.
        if (fresh || messages.some(({ event }) => event === "recordings")) tell({ type: "recordings" });
        fresh = false;
      });
    } catch (error) {
      if (ending.signal.reason === UNWANTED) return null;
      if (!(error instanceof TypeError || error instanceof DOMException)) throw error;
    } finally {
      clearTimeout(watchdog);
    }
    return new Problem(0, "page_stream_broken", "live news do not get through: the page asks for them every two seconds");
  }

  /**
   * Ask for the status, because the stream does not bring it.
   *
   * @param {Problem} why
   * @returns {Promise<boolean>} whether it came
   */
  async function ask({ code, message }) {
    try {
      const status = await call("GET", "status", undefined, ASK_DEADLINE_MS);
      tell({ type: "status", status, heard: Date.now(), why: { code, text: message } });
      return true;
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      return false;
    }
  }

  /** Fetch pictures while a tab shows them: the next one when somebody has shown the last one. */
  async function look() {
    if (looking) return;
    looking = true;
    while (viewers().length) {
      const why = await fetchPicture();
      if (why) {
        tell({ type: "no-picture", why: why.status === 503 ? { code: why.code, text: why.message } : null });
        await new Promise((resolve) => setTimeout(resolve, PICTURE_RETRY_MS));
      }
    }
    looking = false;

    /** @returns {Promise<Problem|null>} why none came */
    async function fetchPicture() {
      try {
        const answer = await fetch(`${API}preview.jpg?after=${pulse}`, { signal: AbortSignal.timeout(PICTURE_DEADLINE_MS) });
        if (!answer.ok) return await asProblem(answer);
        if (answer.status === 204) return null;
        const image = await answer.blob();
        pulse = answer.headers.get("X-Svev-Pulse") ?? "0";
        for (const tab of viewers()) {
          tab.ready = false;
          tab.port.postMessage({ type: "picture", image });
        }
        return null;
      } catch (error) {
        if (!(error instanceof TypeError || error instanceof DOMException)) throw error;
        return new Problem(0, "page_no_connection", "");
      }
    }
  }

  /**
   * @param {Tab} tab
   * @param {Request} request
   */
  function hear(tab, request) {
    if (request.type === "bye") tabs.delete(tab);
    if (request.type === "shown") tab.ready = true;
    if (request.type === "wish") {
      if (request.picture && !tab.picture) {
        tab.ready = true; // one that was on its way has got lost
        pulse = "0";
      }
      Object.assign(tab, { visible: request.visible, picture: request.picture });
    }
    if (request.type === "retry") {
      delayMs = FIRST_DELAY_MS;
      wake();
    }
    if (request.type === "renew") [last, events] = [null, []];
    if (!wanted() || request.type === "renew") {
      stream.abort(UNWANTED);
      wake();
    }
    void follow();
    void look();
  }

  return (port) => {
    const tab = { port, visible: false, picture: false, ready: true };
    tabs.add(tab);
    port.onmessage = ({ data }) => hear(tab, data);
    if (events.length) port.postMessage({ type: "log", fresh: true, events });
    if (last) port.postMessage(last);
  };
}

/** @typedef {{ event: string, data: string }} Message */

/**
 * Read server-sent events to the end of the stream. (EventSource does not say why it fails.)
 *
 * @param {ReadableStream<Uint8Array<ArrayBuffer>>} body
 * @param {(messages: Message[]) => void} heard gets the messages that came together
 */
async function readEvents(body, heard) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const blocks = (rest + value).split("\n\n");
    rest = blocks.pop() ?? "";
    const messages = blocks.map(parse).filter(({ data }) => data);
    if (messages.length) heard(messages);
  }
}

/**
 * @param {string} block the lines of one message, as the service writes them: each field on one line
 * @returns {Message}
 */
function parse(block) {
  const fields = Object.fromEntries(block.split("\n").map((line) => {
    const colon = line.indexOf(": ");
    return [line.slice(0, colon), line.slice(colon + 2)];
  }));
  return { event: fields.event ?? "message", data: fields.data ?? "" };
}
