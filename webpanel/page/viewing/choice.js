/**
 * Which camera of a triplet is large: by buttons, by swiping, and the whole screen for it.
 *
 * @typedef {object} Choice
 * @property {(index: number|null) => void} choose one camera large, or all
 * @property {(names: string[]) => void} offer these cameras; where there is no room for all, the first is large
 * @property {() => void} draw the words anew, in another language
 */

import { t } from "../i18n/i18n.js";
import { $, make } from "../shared/dom.js";
import { onSwipe } from "../shared/swipe.js";

/** The window is too narrow for all cameras side by side. */
const NARROW = matchMedia("(max-width: 599px)");

/**
 * Let the player fill the screen; the window where a browser gives nobody the screen, as on iPhones.
 *
 * @param {boolean} filling
 */
function fill(filling) {
  $("player").classList.toggle("filling", filling);
  $("frame-full").setAttribute("aria-pressed", String(filling));
}

/**
 * @param {import("../shared/viewer.js").Viewer} viewer
 * @param {HTMLElement} frame that it is in
 * @param {() => void} changed called when another camera is large
 * @returns {Choice}
 */
export function makeChoice(viewer, frame, changed) {
  /** @type {string[]} */
  let names = [];

  /** @param {number|null} index */
  function choose(index) {
    viewer.select(index);
    changed();
    [...$("frame-cameras").children].forEach((button, place) => button.setAttribute("aria-pressed", String(place === (viewer.selected() ?? -1) + 1)));
    $("frame-places").replaceChildren(...names.map((_, place) => make("i", place === viewer.selected() ? { class: "here" } : {})));
  }

  function draw() {
    $("frame-cameras").replaceChildren(...[t("scrub.all"), ...names].map((name, place) => make(
      "button", { type: "button", "aria-pressed": String(place === (viewer.selected() ?? -1) + 1), onclick: () => choose(place ? place - 1 : null) }, name,
    )));
  }

  onSwipe(frame, (step) => {
    const selected = viewer.selected();
    if (selected !== null && !frame.classList.contains("zoomed")) choose((selected + step + names.length) % names.length);
  });
  // A phone that is turned goes on with the camera that is looked at.
  NARROW.addEventListener("change", () => { if (NARROW.matches && names.length && viewer.selected() === null) choose(0); });

  $("frame-full").addEventListener("click", () => {
    if (!document.fullscreenEnabled) fill(!$("player").classList.contains("filling"));
    else void (document.fullscreenElement ? document.exitFullscreen() : $("player").requestFullscreen());
  });
  document.addEventListener("fullscreenchange", () => fill(document.fullscreenElement !== null));
  addEventListener("hashchange", () => { if (!document.fullscreenEnabled) fill(false); });
  $("frame-more").addEventListener("click", () => $("frame-more").setAttribute("aria-expanded", String($("player").classList.toggle("more"))));

  return {
    choose,
    draw,
    offer(newNames) {
      names = newNames;
      draw();
      choose(NARROW.matches ? 0 : null);
    },
  };
}
