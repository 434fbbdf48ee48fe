/** A stretch of the recording shown, marked from one pulse in sight to another: what an export takes. */

import { $ } from "../shared/dom.js";
import { pulseShown } from "./scrubber.js";
import { markStretch } from "./strip.js";

/** @typedef {"first"|"last"} End */

/**
 * Numbers of the recording's pulses, in order.
 *
 * @type {number[]}
 */
let numbers = [];
/**
 * The ends that are marked.
 *
 * @type {Record<End, number|null>}
 */
let ends = { first: null, last: null };
/** @type {() => void} */
let changed = () => {};

/** @param {() => void} action called when the marks have changed */
export function startMarking(action) {
  changed = action;
  for (const end of /** @type {End[]} */ (["first", "last"])) {
    $(`mark-${end}`).addEventListener("click", () => {
      const here = pulseShown();
      mark(end, ends[end] === here ? null : here);
    });
  }
}

/**
 * Begin with a recording: nothing is marked.
 *
 * @param {number[]} pulses their numbers
 */
export function beginMarking(pulses) {
  [numbers, ends] = [pulses, { first: null, last: null }];
  draw();
}

/**
 * Mark one end; null: up to the end of the recording. The other end goes if the stretch would run backwards.
 *
 * @param {End} end
 * @param {number|null} pulse
 */
export function mark(end, pulse) {
  ends[end] = pulse;
  const { first, last } = ends;
  if (first !== null && last !== null && first > last) ends[end === "first" ? "last" : "first"] = null;
  draw();
}

/** The pulses at the ends of the stretch; null: that of the recording. */
export function marked() {
  return { ...ends };
}

function draw() {
  const { first, last } = ends;
  const from = first === null ? 0 : numbers.findIndex((pulse) => pulse >= first);
  const to = last === null ? numbers.length - 1 : numbers.findLastIndex((pulse) => pulse <= last);
  markStretch($("frame-strip"), (first === null && last === null) || from < 0 || to < from ? null : { first: from, last: to });
  for (const [end, pulse] of Object.entries(ends)) $(`mark-${end}`).setAttribute("aria-pressed", String(pulse !== null));
  changed();
}
