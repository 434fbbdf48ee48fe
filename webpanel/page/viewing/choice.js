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

/** The window is too narrow for all cameras side by side. */
const NARROW = matchMedia("(max-width: 599px)");
const SWIPE_PX = 40;

/**
 * @param {import("../shared/viewer.js").Viewer} viewer
 * @param {HTMLElement} frame that it is in
 * @param {() => void} changed called when another camera is large
 * @returns {Choice}
 */
export function makeChoice(viewer, frame, changed) {
  /** @type {string[]} */
  let names = [];
  /** Where the finger was put down; null: it was not, or there are two. @type {number|null} */
  let touchedAt = null;

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

  frame.addEventListener("pointerdown", (event) => { touchedAt = event.pointerType === "mouse" || !event.isPrimary ? null : event.clientX; });
  frame.addEventListener("pointerup", (event) => {
    const pixels = event.clientX - (touchedAt ?? event.clientX);
    const selected = viewer.selected();
    touchedAt = null;
    if (selected === null || Math.abs(pixels) < SWIPE_PX || frame.classList.contains("zoomed")) return;
    choose((selected + (pixels < 0 ? 1 : -1) + names.length) % names.length);
  });
  NARROW.addEventListener("change", () => { if (names.length) choose(NARROW.matches ? 0 : null); });

  $("frame-full").hidden = !document.fullscreenEnabled;
  $("frame-full").addEventListener("click", () => void (document.fullscreenElement ? document.exitFullscreen() : $("player").requestFullscreen()));
  document.addEventListener("fullscreenchange", () => $("frame-full").setAttribute("aria-pressed", String(document.fullscreenElement !== null)));
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
