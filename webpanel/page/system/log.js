/** The view of the live log, newest event on top. */

import { say, t } from "../i18n/i18n.js";
import { hear } from "../shared/connection.js";
import { $, make } from "../shared/dom.js";
import { timeOfDay } from "../shared/format.js";
import { known, watch } from "../shared/store.js";

const LEVELS = ["debug", "info", "warning", "error", "fatal"];
const KEPT = 500;
/** Lines that say the same are one if no longer time than this lies between one and the next. */
const TOGETHER_MS = 60_000;
/** What events are about, beside cameras, which have names of their own. */
const NAMES = [
  "access", "analysis", "computer", "disk", "light barrier", "mark", "pairing", "publisher", "pulses", "recorder", "rehearsal", "service", "start list",
  "trigger", "truth", "webhook",
];

/** @typedef {import("../shared/types.js").Event} Event */

/** @type {Event[]} */
let events = [];
/** Whether the list on the page shows all of them. */
let drawn = false;
/** Whether it will be drawn at the next animation frame. */
let planned = false;

export function startLog() {
  hear({
    opened: () => { events = []; changed(); },
    log: (event) => { events = [event, ...events].slice(0, KEPT); changed(); },
  });
  $("log-level").addEventListener("change", changed);
  watch(draw);
}

/** Draw at the next animation frame: at the beginning hundreds of events come at once. */
function changed() {
  drawn = false;
  if (planned) return;
  planned = true;
  requestAnimationFrame(() => { planned = false; draw(); });
}

/** Draw the list if the view is shown and something is new. */
function draw() {
  if (known.view !== "log" || drawn) return;
  drawn = true;
  const least = LEVELS.indexOf($("log-level").value);
  const shown = events.filter((event) => LEVELS.indexOf(event.level) >= least);
  $("log-empty").hidden = shown.length > 0;
  $("log-list").hidden = !shown.length;
  $("log-list").replaceChildren(...grouped(shown).map(({ last: { level, name, code, message, values, time }, count }) => make("li", { "data-level": level },
    make("time", { dateTime: time }, timeOfDay(time)), make("span", { class: "log-level" }, t(`log.is_${level}`)), make("strong", {}, NAMES.includes(name) ? t(`log.of_${name.replace(" ", "_")}`) : name),
    make("span", { class: "log-message" }, say({ code, text: message, values }).text, count > 1 ? make("b", { class: "log-count" }, t("log.times", { count })) : null))));
}

/**
 * Lines that say the same soon after each other, as one with their number, where the last of them stands.
 *
 * @param {Event[]} all newest first
 * @returns {{ last: Event, count: number, first: number }[]} first: when the earliest was, ms
 */
function grouped(all) {
  /** @type {Map<string, { last: Event, count: number, first: number }>} */
  const open = new Map();
  const groups = [];
  for (const event of all) {
    const [key, time] = [`${event.level} ${event.name} ${event.message}`, Date.parse(event.time)];
    let group = open.get(key);
    if (group && group.first - time < TOGETHER_MS) group.count += 1;
    else {
      group = { last: event, count: 1, first: time };
      open.set(key, group);
      groups.push(group);
    }
    group.first = time;
  }
  return groups;
}
