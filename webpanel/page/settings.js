/** Language, look, keys: the help. */

import { $, setText } from "./dom.js";
import { chooseLanguage, languageInUse, t } from "./i18n.js";
import { drawKeys } from "./keys.js";
import { chooseLook, lookChosen } from "./look.js";
import { known } from "./store.js";

/** @param {() => void} redraw draws every part of the page in the new language */
export function startSettings(redraw) {
  $("open-settings").addEventListener("click", openSettings);
  $("settings-close").addEventListener("click", () => $("settings").close());
  $("settings").addEventListener("click", (/** @type {MouseEvent} */ event) => {
    if (event.target === $("settings")) $("settings").close(); // the dimmed page around it
  });
  $("language").addEventListener("change", () => { chooseLanguage($("language").value); redraw(); draw(); });
  $("look").addEventListener("change", () => chooseLook($("look").value));
}

export function openSettings() {
  draw();
  $("settings").showModal();
}

function draw() {
  $("language").value = languageInUse();
  $("look").value = lookChosen();
  drawKeys();
  setText($("about"), t("about", { version: known.status?.version ?? "–", rig: known.status?.rig ?? "–" }));
}
