/** Follows what is measured in this pulse through those before or after it. */

import { t } from "../i18n/i18n.js";
import { $, make } from "../shared/dom.js";
import { attempt, tell } from "../shared/snacks.js";
import { said } from "./advance.js";
import { refineTarget, select, target } from "./marking.js";
import { track } from "./server.js";
import { reloadAll } from "./session.js";
import { cameras, change, indexOf, listed, state, thingOf, watch } from "./state.js";
import { titleOf } from "./things.js";

/** Which way was tracked last: the end of the run is searched in it. @type {1|-1} */
let direction = 1;

export function startTracking() {
  $("track-back").addEventListener("click", () => void follow(-1));
  $("track-on").addEventListener("click", () => void follow(1));
  $("track-end").addEventListener("click", toEndOfRun);
  watch(() => { for (const part of ["track-back", "track-on"]) $(part).disabled = state.busy !== ""; });
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
  change({ busy: "digitize.tracking" });
  const most = Math.max(1, Math.round(Number($("track-most").value) || 30));
  const found = await attempt(() => track(state.operator, { things, pulse: state.pulse, direction: way, most }));
  change({ busy: "" });
  if (!found) return;
  await reloadAll();
  $("track-said").replaceChildren(...things.map((thing) => make("li", {}, t("digitize.tracked", {
    thing: titleOf(thing), count: String(found.tracked[thing]?.length ?? 0), why: found.stopped[thing] ?? t("digitize.track_whole"),
  }))));
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
  change({ busy: "digitize.tracking" });
  const found = await attempt(() => track(state.operator, { things: [thing], pulse: state.pulse, direction: 1, most: 0 }));
  change({ busy: "" });
  if (!found) return;
  await reloadAll();
  if (!found.tracked[thing]?.length) tell("info", found.stopped[thing] ?? t("digitize.track_nothing"));
}

/** Go to the last pulse to which the selected thing was followed without a gap. */
export function toEndOfRun() {
  const pulses = state.opening?.pulses ?? [];
  const marked = (/** @type {number} */ pulse) => cameras().some((camera) => "mrta".includes(state.session?.coverage[state.thing]?.[camera]?.[pulse] ?? "-"));
  let at = indexOf(state.pulse);
  while (pulses[at + direction] !== undefined && marked(pulses[at + direction])) at += direction;
  select({ pulse: pulses[at] });
}
