/** Calls the REST API. Every failure is thrown as a Problem, whose message says what to do. */

/** Where the API is, from the page as well as from a worker: this module stands at page/VERSION/shared/. */
export const API = new URL("../../../api/", import.meta.url).href;
const DEADLINE_MS = 10_000;

/** @typedef {{ code: string, text: string, values?: import("./types.js").Values }} Said */

/** An error to show: `code` for its translation, the message in English. */
export class Problem extends Error {
  /**
   * @param {number} status HTTP status; 0: there was no answer
   * @param {string} code
   * @param {string} detail
   * @param {Said|null} [told] the detail with a code of its own and the values in it
   */
  constructor(status, code, detail, told = null) {
    super(detail);
    this.status = status;
    this.code = code;
    /** To be said: in words of its kind, which may quote the detail, where that has no code of its own. @type {Said} */
    this.said = told ?? { code, text: detail, values: { detail } };
    /** To be said within a sentence: the detail itself. @type {Said} */
    this.detail = told ?? { code: "", text: detail };
  }
}

/** @type {() => void} */
let whenTokenIsNeeded = () => {};

/**
 * Set what to do when the service asks for the token.
 *
 * @param {() => void} action
 */
export function onTokenNeeded(action) {
  whenTokenIsNeeded = action;
}

/** Ask for the token: the service wants it. */
export function needToken() {
  whenTokenIsNeeded();
}

/**
 * Call the service.
 *
 * @param {string} method
 * @param {string} path below /api/
 * @param {object} [body] sent as JSON; a Blob as what it is
 * @param {number} [deadlineMs] time after which the call counts as unanswered
 * @returns {Promise<any>} the answer's JSON; null if it has none
 * @throws {Problem}
 */
export async function call(method, path, body, deadlineMs = DEADLINE_MS) {
  return (await ask(method, path, body, deadlineMs)).content;
}

/**
 * Ask for one page of a list.
 *
 * @param {string} path below /api/
 * @returns {Promise<{ items: any[], total: number }>} `total`: how many there are on all pages
 * @throws {Problem}
 */
export async function callForPage(path) {
  const { answer, content } = await ask("GET", path, undefined, DEADLINE_MS);
  return { items: content, total: Number(answer.headers.get("X-Total-Count") ?? content.length) };
}

/**
 * @param {string} method
 * @param {string} path
 * @param {object|undefined} body
 * @param {number} deadlineMs
 * @returns {Promise<{ answer: Response, content: any }>}
 */
async function ask(method, path, body, deadlineMs) {
  /** @type {RequestInit} */
  const content = body === undefined ? {} : contentOf(body);
  let answer;
  try {
    answer = await fetch(API + path, {
      method, ...content, cache: "no-store", signal: AbortSignal.timeout(deadlineMs),
    });
    if (answer.ok) return { answer, content: answer.status === 204 ? null : await answer.json() };
  } catch (error) {
    const late = error instanceof DOMException && error.name === "TimeoutError";
    throw late
      ? new Problem(0, "page_timeout", "no answer in time: look whether it happened all the same, then try again")
      : new Problem(0, "page_no_connection", "no connection to the service: check network and service, then try again");
  }
  const problem = await asProblem(answer);
  if (problem.status === 401 && path !== "login") needToken();
  throw problem;
}

/**
 * @param {object} body
 * @returns {RequestInit}
 */
function contentOf(body) {
  if (body instanceof Blob) return { headers: { "Content-Type": body.type }, body };
  return { headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
}

/**
 * What an answer that is no success says.
 *
 * @param {Response} answer
 * @returns {Promise<Problem>}
 */
export async function asProblem(answer) {
  if (!answer.headers.get("Content-Type")?.includes("json")) {
    return new Problem(answer.status, "page_strange", `the service answers ${answer.status} ${answer.statusText}: look at its log`);
  }
  const { code, detail, title, said } = await answer.json();
  return new Problem(answer.status, code ?? "", detail || title, said ?? null);
}

/**
 * Path of a recording, for `call`.
 *
 * @param {string} id
 * @param {string} [part] e.g. "/stop"
 */
export function recordingPath(id, part = "") {
  return `recordings/${encodeURIComponent(id)}${part}`;
}

/**
 * Address of several recordings as one archive, with all their parts.
 *
 * @param {string[]} ids
 */
export function archiveOf(ids) {
  return `./api/recordings.zip?ids=${ids.map((id) => encodeURIComponent(encodeURIComponent(id))).join(",")}`;
}

/**
 * Address of a part of a recording, for images and links.
 *
 * @param {string} id
 * @param {string} part e.g. "file"
 */
export function partOf(id, part) {
  return `./api/${recordingPath(id, `/${part}`)}`;
}
