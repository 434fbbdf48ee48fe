/** The tape: two things, each clicked in two views, give a length with its sigma. Nothing of it is kept. */

import { t } from "../../i18n/i18n.js";
import { $, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { attempt } from "../../shared/snacks.js";
import { measureTape } from "../session/server.js";
import { change, state, watch } from "../session/state.js";

/** Views in which each end is clicked. */
const VIEWS = 2;

export function startTape() {
  $("tape").addEventListener("click", toggleTape);
  watch(() => {
    $("tape").setAttribute("aria-pressed", String(state.tape !== null));
    setText($("tape-says"), words());
  });
}

/** Begin with the tape, or put it away. */
export function toggleTape() {
  change({ tape: state.tape ? null : { from: {}, to: {}, measured: null } });
}

function words() {
  const { tape } = state;
  if (!tape) return "";
  if (tape.measured) return t("digitize.tape_length", { length: number(tape.measured.value, 3), sigma: number(tape.measured.sigma, 3) });
  const end = Object.keys(tape.from).length < VIEWS ? "from" : "to";
  return t(end === "from" ? "digitize.tape_first" : "digitize.tape_second", { count: VIEWS - Object.keys(tape[end]).length });
}

/**
 * Take a click: the first two, in two views, are the first thing, the next two the second one.
 *
 * @param {string} camera
 * @param {import("../types.js").Place} xy
 */
export async function holdTape(camera, xy) {
  const before = state.tape?.measured ? null : state.tape;
  const { from, to } = before ?? { from: {}, to: {} };
  const first = Object.keys(from).length < VIEWS;
  const tape = { from: first ? { ...from, [camera]: xy } : from, to: first ? to : { ...to, [camera]: xy }, measured: null };
  change({ tape });
  if (Object.keys(tape.to).length < VIEWS) return;
  const measured = await attempt(() => measureTape({ pulse: state.pulse, from: tape.from, to: tape.to }));
  if (state.tape === tape) change({ tape: measured ? { ...tape, measured } : { from: {}, to: {}, measured: null } });
}
