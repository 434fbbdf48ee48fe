/** The settings dialog: language, look (light, dark or outdoor), and the list of keys. */

import { chooseLanguage, languageInUse, t } from "../i18n/i18n.js";
import { $, setText } from "../shared/dom.js";
import { attempt } from "../shared/snacks.js";
import { known, load, save } from "../shared/store.js";

/**
 * Take up the look chosen last, and let the dialog be opened.
 *
 * @param {() => void} redraw draws every part of the page in the new language
 */
export function startSettings(redraw) {
  setLook(look());
  $("open-settings").addEventListener("click", openSettings);
  $("settings-coach").addEventListener("click", () => $("settings").close());
  $("settings-close").addEventListener("click", () => $("settings").close());
  $("settings").addEventListener("click", (/** @type {MouseEvent} */ event) => {
    if (event.target === $("settings")) $("settings").close(); // the dimmed page around it
  });
  $("language").addEventListener("change", () => void attempt(async () => {
    try {
      await chooseLanguage($("language").value);
      redraw();
    } finally {
      draw();
    }
  }));
  $("look").addEventListener("change", () => { save("look", $("look").value); setLook($("look").value); });
}

export function openSettings() {
  draw();
  $("settings").showModal();
}

function draw() {
  $("language").value = languageInUse();
  $("look").value = look();
  setText($("about"), t("about", { version: known.status?.version ?? "–", rig: known.status?.rig ?? "–" }));
}

/** The look chosen last. "auto" follows the device; "outdoor" is black on white with thick lines, for sun on snow. */
function look() {
  return load("look", "auto");
}

/** @param {string} chosen */
function setLook(chosen) {
  document.documentElement.dataset.look = chosen;
}
