/** Light, dark, or outdoor: black on white with thick lines, for sun on snow. */

import { load, save } from "./memory.js";

export function startLook() {
  setLook(load("look", "auto"));
}

/** @param {string} look "auto" follows the device */
export function chooseLook(look) {
  save("look", look);
  setLook(look);
}

export function lookChosen() {
  return load("look", "auto");
}

/** @param {string} look */
function setLook(look) {
  document.documentElement.dataset.look = look;
}
