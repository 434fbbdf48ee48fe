/** The session of the operator: what is marked, kept true with the service; each act goes there at once, in order. */

import { t } from "../../i18n/i18n.js";
import { Problem } from "../../shared/api.js";
import { attempt, tell, tellProblem } from "../../shared/snacks.js";
import { known } from "../../shared/store.js";
import { cover, said } from "./advance.js";
import { act, getChanges, getPulse, getSession } from "./server.js";
import { change, indexOf, redraw, state } from "./state.js";

/** @typedef {import("../types.js").PulseView} PulseView */
/** @typedef {import("./server.js").Action} Action */

/** Views of pulses are kept, so many. */
const KEPT = 200;
/** After a call without an answer, the next one waits so long, ms. */
const AGAIN_MS = 2000;

/** Views by pulse, as they were last told. @type {Map<number, PulseView>} */
const views = new Map();
/** The acts on their way. @type {Promise<unknown>} */
let queue = Promise.resolve();
/** How many they are. */
let waiting = 0;
/** Whether a view is on its way, and whether it will be old when it comes. */
let [loading, again] = [false, false];

/**
 * Take up the session of an operator.
 *
 * @param {string} operator
 */
export async function openSession(operator) {
  views.clear();
  change({ operator, session: null, view: null });
  await reloadSession();
  await reloadView();
  void followChanges(operator);
}

/**
 * Show a pulse; its marks follow.
 *
 * @param {number} pulse of the log; another one is not shown
 */
export function showPulse(pulse) {
  if (indexOf(pulse) < 0 || pulse === state.pulse) return;
  change({ pulse, view: views.get(pulse) ?? null, vertex: null, live: null, dragged: null, curves: {} });
  if (!state.view && !state.playing) void reloadView();
}

/** Load what is marked in the pulse in sight. Those passed meanwhile are not asked for. */
export async function reloadView() {
  if (!state.operator) return;
  again = loading;
  if (loading) return;
  loading = true;
  try {
    do {
      again = false;
      const { operator, pulse } = state;
      const view = await attempt(() => getPulse(operator, pulse));
      if (view && operator === state.operator) keep(view);
    } while (again);
  } finally {
    loading = false;
  }
}

/** Load coverage, depth of undo, and the rays that fit worst. */
export async function reloadSession() {
  const { operator } = state;
  if (!operator) return;
  const session = await attempt(() => getSession(operator));
  if (session && operator === state.operator) change({ session });
}

/** @param {PulseView} view */
function keep(view) {
  const before = views.get(view.pulse);
  if (before && before.revision > view.revision) return; // an answer that was overtaken
  views.delete(view.pulse);
  views.set(view.pulse, view);
  for (const pulse of views.keys()) if (views.size > KEPT) views.delete(pulse);
  if (view.pulse === state.pulse && waiting) return; // what was done since is seen already
  if (state.session) cover(state.session.coverage, view);
  if (view.pulse === state.pulse) change({ view });
  else redraw();
}

/**
 * Do something: it is seen at once, and kept when the service has answered.
 *
 * @param {Action} action
 * @returns {Promise<import("../types.js").Changed|null>} null: it was refused, which the page says
 */
export function send(action) {
  if (known.role === "watch") {
    tell("info", t("digitize.only_look"));
    return Promise.resolve(null);
  }
  foresee(action);
  waiting += 1;
  const { operator } = state;
  const answered = queue.then(() => answerTo(operator, action));
  queue = answered.catch(() => null);
  return answered;
}

/** Resolves when all that was done is kept. */
export async function sent() {
  await queue;
}

/**
 * @param {string} operator
 * @param {Action} action
 */
async function answerTo(operator, action) {
  try {
    const answer = await act(operator, action);
    waiting -= 1;
    const { revision, undo, redo, touched, view } = answer;
    const others = revision > (state.session?.revision ?? revision) + 1;
    if (state.session) Object.assign(state.session, { revision, undo, redo });
    // What is a pulse away shows this mark as its ghost, and computes from it.
    for (const pulse of views.keys()) if (pulse !== touched?.pulse) views.delete(pulse);
    if (view) keep(view);
    if (others) void reloadAll(); // another browser was at work in this session
    return answer;
  } catch (error) {
    waiting -= 1;
    tellProblem(error);
    views.delete(state.pulse);
    void reloadView();
    return null;
  }
}

/**
 * Show what an act will do, before the service has answered.
 *
 * @param {Action} action
 */
function foresee(action) {
  if (action.do === "undo" || action.do === "redo") return;
  if (!state.view || action.pulse !== state.pulse) return;
  const view = structuredClone(state.view);
  const { camera, thing, pulse } = action;
  const marks = (view.marks[camera] ??= {});
  const line = state.opening?.things.find(({ name }) => name === thing)?.kind === "line";
  if (action.do === "remove") {
    const left = action.vertex === null ? [] : (said(view, camera, thing)?.marks ?? []).filter(({ vertex }) => vertex !== action.vertex);
    delete marks[thing];
    if (left.length) marks[thing] = { state: "measured", vertices: left };
  } else if (action.do === "state") {
    marks[thing] = line
      ? { state: action.state, vertices: [] }
      : { pulse, camera, thing, vertex: null, state: action.state, xy: null, sigma: null, source: "hand" };
  } else {
    const { xy, sigma, source } = action;
    const before = line ? (said(view, camera, thing)?.marks ?? []).filter((mark) => mark.xy && mark.vertex !== action.vertex) : [];
    const vertex = line ? action.vertex ?? 1 + Math.max(-1, ...before.map((mark) => mark.vertex ?? 0)) : null;
    const mark = { pulse, camera, thing, vertex, state: action.state, xy, sigma, source };
    marks[thing] = line ? { state: action.state, vertices: [...before, mark].sort((a, b) => (a.vertex ?? 0) - (b.vertex ?? 0)) } : mark;
  }
  if (state.session) cover(state.session.coverage, view);
  change({ view });
}

/**
 * Take back the last act, or do it again; what was touched comes into sight.
 *
 * @param {"undo"|"redo"} which
 */
export async function takeBack(which) {
  const answer = await send({ do: which });
  if (!answer?.touched) return;
  const { pulse, camera, thing } = answer.touched;
  const group = state.opening?.things.find(({ name }) => name === thing)?.group ?? state.group;
  showPulse(pulse);
  change({ camera, thing, group, vertex: null });
  const changes = await attempt(() => getChanges(state.operator, answer.revision - 1));
  if (changes && changes.touched.length > 1) await reloadSession(); // a whole run, or a file that was read
}

/** After many marks were made at once: load all anew. */
export async function reloadAll() {
  views.clear();
  await Promise.all([reloadSession(), reloadView()]);
}

/**
 * Take over what another browser does in this session.
 *
 * @param {string} operator
 */
async function followChanges(operator) {
  while (operator === state.operator) {
    try {
      const { revision, touched } = await getChanges(operator, state.session?.revision ?? 0);
      if (operator !== state.operator) return;
      if (state.cut) change({ cut: false });
      const seen = state.session?.revision ?? 0;
      if (revision <= seen || waiting || !touched.length) { await soon(touched.length ? 50 : 0); continue; }
      await reloadAll();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      change({ cut: error.status === 0 });
      await soon(AGAIN_MS);
    }
  }
}

/** @param {number} ms */
function soon(ms) {
  return new Promise((resolve) => { setTimeout(resolve, ms); });
}
