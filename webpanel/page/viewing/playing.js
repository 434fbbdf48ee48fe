/**
 * Plays a recording at the speed of the jump or slower, once or in a loop about the moment that matters.
 *
 * @typedef {object} Scene what is played
 * @property {() => import("../shared/types.js").PulseSummary[]} pulses
 * @property {() => number} at index of the pulse in sight
 * @property {() => number|null} moment index of the pulse that matters
 * @property {() => boolean} ready the pulse in sight can be seen
 * @property {(index: number) => void} show
 *
 * @typedef {object} Player
 * @property {() => void} toggle
 * @property {() => void} pause
 * @property {() => void} toggleLoop plays in a loop from its beginning, in slow motion; or ends that
 * @property {(direction: 1|-1) => void} changeSpeed 1: slower
 * @property {() => void} draw the words anew, in another language
 */

import { t } from "../i18n/i18n.js";
import { $, make, setIcon } from "../shared/dom.js";

/** How many times slower than the jump. */
const SLOWER = [1, 2, 3, 5, 10];
/** A loop begins so long before the moment that matters and ends so long after it, s. */
const [BEFORE_S, AFTER_S] = [0.5, 1];
/** How many times slower than the jump a loop begins, unless somebody has chosen. */
const LOOP_SLOWER = 5;

/**
 * @param {Scene} scene
 * @returns {Player}
 */
export function makePlayer(scene) {
  /** When playing began, and the time of its first pulse; null: not playing. @type {{ clock: number, time_s: number }|null} */
  let playing = null;
  let looping = false;

  /** First and last index of what is played. */
  function stretch() {
    const [pulses, moment] = [scene.pulses(), scene.moment()];
    const last = pulses.length - 1;
    if (!looping || moment === null) return [0, last];
    const middle = pulses[moment].time_s;
    const after = pulses.findIndex(({ time_s }) => time_s > middle + AFTER_S);
    return [pulses.findIndex(({ time_s }) => time_s >= middle - BEFORE_S), after < 0 ? last : after - 1];
  }

  /** @param {number} index where to play on */
  function playFrom(index) {
    playing = { clock: performance.now(), time_s: scene.pulses()[index].time_s };
    scene.show(index);
  }

  /** Frames for which the connection is too slow are skipped. */
  function playOn() {
    if (!playing) return;
    const pulses = scene.pulses();
    const [first, last] = stretch();
    const now = playing.time_s + (performance.now() - playing.clock) / 1000 / Number($("frame-speed").value);
    let next = scene.at();
    while (next < last && pulses[next + 1].time_s <= now) next += 1;
    if (scene.ready() && next !== scene.at()) scene.show(next);
    if (scene.at() < last) requestAnimationFrame(playOn);
    else if (!looping) pause();
    else if (last > first) {
      playFrom(first);
      requestAnimationFrame(playOn);
    }
  }

  function pause() {
    playing = null;
    drawPlay();
  }

  function drawPlay() {
    setIcon($("frame-play").querySelector("svg"), playing ? "pause" : "play");
    $("frame-play").setAttribute("aria-label", t(playing ? "scrub.pause" : "scrub.play"));
  }

  $("frame-speed").addEventListener("change", () => { if (playing) playFrom(scene.at()); });

  return {
    pause,
    toggle() {
      if (playing || !scene.pulses().length) return pause();
      const [first, last] = stretch();
      playFrom(scene.at() >= last || scene.at() < first ? first : scene.at());
      drawPlay();
      requestAnimationFrame(playOn);
    },
    toggleLoop() {
      looping = !(looping && playing); // one that somebody has stopped begins again by one tap
      $("frame-loop").setAttribute("aria-pressed", String(looping));
      if (!looping || !scene.pulses().length) return pause();
      if (Number($("frame-speed").value) === 1) $("frame-speed").value = String(LOOP_SLOWER);
      if (!playing) requestAnimationFrame(playOn);
      playFrom(stretch()[0]);
      drawPlay();
    },
    changeSpeed(direction) {
      const next = SLOWER[SLOWER.indexOf(Number($("frame-speed").value)) + direction];
      if (next === undefined) return;
      $("frame-speed").value = String(next);
      if (playing) playFrom(scene.at());
    },
    draw() {
      const chosen = $("frame-speed").value || "1";
      $("frame-speed").replaceChildren(...SLOWER.map((factor) => make("option", { value: String(factor) }, `1/${factor}`)));
      $("frame-speed").value = chosen;
      drawPlay();
    },
  };
}
