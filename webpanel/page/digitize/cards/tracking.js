/** Follows what is measured in this pulse through those before or after it; a program of the service's does it meanwhile. */

import { say, t } from "../../i18n/i18n.js";
import { $, make, setText } from "../../shared/dom.js";
import { attempt, tell } from "../../shared/snacks.js";
import { refineTarget, select, target } from "../marking/marking.js";
import { said } from "../session/advance.js";
import { cancelTracking, getTracking, track } from "../session/server.js";
import { reloadAll, sent } from "../session/session.js";
import { cameras, change, indexOf, listed, state, thingOf, watch } from "../session/state.js";
import { titleOf } from "./things.js";

/** @typedef {import("../types.js").Tracking} Tracking */

const LOOK_AGAIN_MS = 300;
/** Which way was tracked last: the end of the run is searched in it. @type {1|-1} */
let direction = 1;
/** What is followed, or was last. @type {Tracking|null} */
let last = null;
/** Whose following is looked at. */
let looking = "";

export function startTracking() {
  $("track-back").addEventListener("click", () => void follow(-1));
  $("track-on").addEventListener("click", () => void follow(1));
  $("track-end").addEventListener("click", toEndOfRun);
  $("track-cancel").addEventListener("click", () => void cancel());
  watch(() => {
    for (const part of ["track-back", "track-on"]) $(part).disabled = state.busy !== "";
    if (state.operator && looking !== state.operator) void look(state.operator); // one may be under way since before
    if (state.drawn && !state.busy) void refineDrawn(state.drawn);
  });
}

/**
 * Find a line that was drawn in all images at once, if two or more of oriented cameras have it.
 *
 * @param {{ thing: string, pulse: number }} drawn
 */
async function refineDrawn({ thing, pulse }) {
  change({ drawn: null });
  const oriented = state.opening?.cameras.filter((camera) => camera.oriented) ?? [];
  if (pulse !== state.pulse || oriented.filter(({ name }) => said(state.view, name, thing)?.state === "measured").length < 2) return;
  await sent();
  await inAllImages(thing, pulse);
}

/** The things that are followed: the selected one, or all that are measured in this pulse. */
function followed() {
  if ($("track-what").value === "one") return [state.thing];
  return listed().map(({ name }) => name).filter((name) => cameras().some((camera) => said(state.view, camera, name)?.state === "measured"));
}

/** @param {1|-1} way */
export async function follow(way) {
  const things = followed();
  if (state.busy || !state.operator) return;
  if (!things.length) return tell("info", t("digitize.track_nothing"));
  direction = way;
  await begin({ things, pulse: state.pulse, direction: way, most: Math.max(1, Math.round(Number($("track-most").value) || 30)) });
}

/**
 * Find the mark on which keys act more exactly: a ski as a whole, in all images of oriented cameras at once; anything
 * else in its own image.
 */
export async function refineHere() {
  const thing = target()?.thing;
  const asOne = thing && thingOf(thing)?.kind === "line" && state.opening?.cameras.some((camera) => camera.oriented);
  if (!asOne) return refineTarget();
  if (state.busy || !state.operator) return;
  await inAllImages(thing, state.pulse);
}

/** @param {string} thing a line that is marked @param {number} pulse */
async function inAllImages(thing, pulse) {
  const found = await begin({ things: [thing], pulse, direction: 1, most: 0 });
  if (found?.state === "done" && !found.tracked[thing]?.length) tell("info", say(found.stopped[thing]).text);
}

/** @param {Parameters<typeof track>[1]} order @returns {Promise<Tracking|null>} what came of it; null: it was refused */
async function begin(order) {
  change({ busy: "digitize.tracking" });
  const begun = await attempt(() => track(state.operator, order));
  if (begun) return look(state.operator);
  change({ busy: "" });
  return null;
}

async function cancel() {
  const answer = await attempt(() => cancelTracking(state.operator));
  if (answer) show(answer);
}

/**
 * Look how far the following is, until it has ended.
 *
 * @param {string} operator
 */
async function look(operator) {
  looking = operator;
  for (let worked = false; ; worked = true) {
    const answer = await attempt(() => getTracking(operator));
    if (operator !== state.operator || !answer) {
      change({ busy: "" });
      return null;
    }
    const works = answer.state === "tracking";
    if (!works && worked) await reloadAll();
    change({ busy: works ? "digitize.tracking" : "" });
    show(answer);
    if (!works) return answer;
    await new Promise((resolve) => { setTimeout(resolve, LOOK_AGAIN_MS); });
  }
}

/** Draw what was followed, perhaps in another language. */
export function drawTracking() {
  if (last) show(last);
}

/** @param {Tracking} now */
function show(now) {
  last = now;
  const works = now.state === "tracking";
  $("track-share").hidden = $("track-cancel").hidden = !works;
  $("track-share").value = now.share;
  setText($("track-state"), now.problem ? say(now.problem).text : now.paused ? t("digitize.result_paused") : "");
  $("track-said").replaceChildren(...Object.entries(now.stopped).map(([thing, why]) => make("li", {}, t("digitize.tracked", {
    thing: titleOf(thing), count: String(now.tracked[thing]?.length ?? 0), why: say(why).text,
  }))));
}

/** Go to the last pulse to which the selected thing was followed without a gap. */
export function toEndOfRun() {
  const pulses = state.opening?.pulses ?? [];
  const marked = (/** @type {number} */ pulse) => cameras().some((camera) => "mrta".includes(state.session?.coverage[state.thing]?.[camera]?.[pulse] ?? "-"));
  let at = indexOf(state.pulse);
  while (pulses[at + direction] !== undefined && marked(pulses[at + direction])) at += direction;
  select({ pulse: pulses[at] });
}
