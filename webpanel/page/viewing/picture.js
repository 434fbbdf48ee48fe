/**
 * Shows the picture of the pulse in sight. One is loaded at a time; pulses passed meanwhile are never asked for.
 *
 * @typedef {object} Picture
 * @property {() => void} load the one that is wanted now
 * @property {() => boolean} ready whether that one is shown
 * @property {() => void} clear show none
 * @property {() => number|null} pulse the one whose picture is shown: on a slow connection it lags behind; null: none is
 */

import { partOf } from "../shared/api.js";

/**
 * @param {HTMLImageElement} image
 * @param {() => { id: string, pulse: number }|null} wanted recording and pulse in sight
 * @param {() => void} changed called when another picture is shown
 * @returns {Picture}
 */
export function makePicture(image, wanted, changed) {
  let loading = false;
  let asked = 0;
  /** @type {number|null} */
  let pulse = null;

  function load() {
    const now = wanted();
    if (!now || loading) return;
    const address = new URL(partOf(now.id, `pulses/${now.pulse}.jpg`), document.baseURI).href;
    if (image.src === address) return;
    [loading, asked] = [true, now.pulse];
    image.src = address;
  }

  image.addEventListener("load", () => {
    loading = false;
    if (!wanted()) return;
    pulse = asked;
    changed();
    load();
  });
  image.addEventListener("error", () => { loading = false; });

  return {
    load,
    ready: () => !loading,
    clear() {
      loading = false;
      pulse = null;
      image.removeAttribute("src");
      image.alt = "";
      changed();
    },
    pulse: () => pulse,
  };
}
