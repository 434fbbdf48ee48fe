/** The live log, newest on top. */

import { $, make } from "./dom.js";
import { hear } from "./events.js";
import { timeOfDay } from "./format.js";
import { known, watch } from "./store.js";

const LEVELS = ["debug", "info", "warning", "error", "fatal"];
const KEPT = 500;

/** @typedef {import("./types.js").Event} Event */

/** @type {Event[]} */
let events = [];
/** Whether the page shows all of them. */
let drawn = false;
/** Whether that will be seen to at the next frame. */
let planned = false;

export function startLog() {
  hear({
    opened: () => { events = []; changed(); },
    log: (event) => { events = [event, ...events].slice(0, KEPT); changed(); },
  });
  $("log-level").addEventListener("change", changed);
  watch(draw);
}

/** At the beginning hundreds come at once: they are drawn together. */
function changed() {
  drawn = false;
  if (planned) return;
  planned = true;
  requestAnimationFrame(() => { planned = false; draw(); });
}

/** Draw it, if it is looked at and something is new. */
function draw() {
  if (known.view !== "log" || drawn) return;
  drawn = true;
  const least = LEVELS.indexOf($("log-level").value);
  const shown = events.filter((event) => LEVELS.indexOf(event.level) >= least);
  $("log-empty").hidden = shown.length > 0;
  $("log-list").hidden = !shown.length;
  $("log-list").replaceChildren(...shown.map(({ level, name, message, time }) => make("li", { "data-level": level },
    make("time", { dateTime: time }, timeOfDay(time)), make("span", { class: "log-level" }, level), make("strong", {}, name), make("span", { class: "log-message" }, message))));
}
