/**
 * Which thing, view and pulse come after the one that was measured. Pure functions.
 *
 * @typedef {import("../types.js").PulseView} PulseView
 * @typedef {"point"|"view"|"pulse"|"stay"} Advance
 * @typedef {{ pulse: number, camera: string, thing: string }} Spot
 * @typedef {object} Plan what is to be measured
 * @property {string[]} things in their order
 * @property {string[]} cameras
 * @property {number[]} pulses
 * @property {(spot: Spot) => boolean} open nothing is said of it yet, and there is a frame
 */

/**
 * @param {Spot} spot
 * @param {Advance} by "point": the next thing in this view, then the next view; "view": the same thing in the next view,
 *   then the next thing; both go to the next pulse at last. "pulse": the same thing in the same view of the next pulse.
 * @param {Plan} plan
 * @returns {Spot} the next one that is open; the same spot if none is
 */
export function next(spot, by, { things, cameras, pulses, open }) {
  if (by === "stay") return spot;
  const at = pulses.indexOf(spot.pulse);
  if (by === "pulse") {
    const pulse = pulses.slice(at + 1).find((number) => open({ ...spot, pulse: number }));
    return pulse === undefined ? spot : { ...spot, pulse };
  }
  const order = by === "point"
    ? cameras.flatMap((camera) => things.map((thing) => ({ camera, thing })))
    : things.flatMap((thing) => cameras.map((camera) => ({ camera, thing })));
  const here = order.findIndex(({ camera, thing }) => camera === spot.camera && thing === spot.thing);
  const rest = [...order.slice(here + 1), ...order.slice(0, here + 1)].map((one) => ({ ...one, pulse: spot.pulse }));
  const following = at + 1 < pulses.length ? order.map((one) => ({ ...one, pulse: pulses[at + 1] })) : [];
  return [...rest, ...following].find(open) ?? spot;
}

/**
 * What was said of a thing in a view: the places (none for what is hidden or not visible) and the state.
 *
 * @param {PulseView|null} view
 * @param {string} camera
 * @param {string} thing
 * @returns {{ state: import("../types.js").MarkState, marks: import("../types.js").Mark[] }|null} null: nothing
 */
export function said(view, camera, thing) {
  const found = view?.marks[camera]?.[thing];
  if (!found) return null;
  return "vertices" in found ? { state: found.state, marks: found.vertices } : { state: found.state, marks: [found] };
}

/**
 * Whether no more is needed of a thing in a view: a line takes two points.
 *
 * @param {PulseView|null} view
 * @param {string} camera
 * @param {import("../types.js").Thing} thing
 */
export function complete(view, camera, { name, kind }) {
  const found = said(view, camera, name);
  if (!found) return false;
  return kind !== "line" || found.state === "hidden" || found.state === "not visible" || found.marks.length >= 2;
}

/**
 * The letters of the coverage of one pulse, as its view has them.
 *
 * @param {Record<string, Record<string, Record<string, string>>>} coverage changed in place: thing, camera, pulse
 * @param {PulseView} view
 */
export function cover(coverage, view) {
  for (const cameras of Object.values(coverage)) for (const pulses of Object.values(cameras)) delete pulses[view.pulse];
  for (const [camera, things] of Object.entries(view.marks)) {
    for (const thing of Object.keys(things)) {
      const found = said(view, camera, thing);
      const letter = found && letterOf(found);
      if (letter) ((coverage[thing] ??= {})[camera] ??= {})[view.pulse] = letter;
    }
  }
}

/** @param {{ state: import("../types.js").MarkState, marks: import("../types.js").Mark[] }} found */
function letterOf({ state, marks }) {
  if (state !== "measured") return { guess: "g", hidden: "h", "not visible": "n" }[state];
  return { hand: "m", refined: "r", tracked: "t", automatic: "a" }[marks.at(-1)?.source ?? "hand"];
}
