/**
 * What is wrong with pulses, clocks and cameras, at the top of every view: in big words, with what to do. The sound that
 * calls for somebody is in signals.js; it is switched off and on here and in the settings.
 */

import { say, t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, icon, make, setIcon, setText } from "../shared/dom.js";
import { timeOfDay } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";
import { setAlarmSound, soundsAlarms } from "./signals.js";

/** @typedef {import("../shared/types.js").Alarm} Alarm */

export function startAlarms() {
  $("alarms-sound").addEventListener("click", () => { setAlarmSound(!soundsAlarms()); draw(); });
  $("signal-alarms").addEventListener("change", draw);
  watch(draw);
}

function draw() {
  const alarms = known.status?.alarms ?? [];
  $("alarms").hidden = !alarms.length;
  const list = $("alarms-list");
  while (list.children.length > alarms.length) list.lastElementChild.remove();
  while (list.children.length < alarms.length) list.append(makeAlarm());
  alarms.forEach((alarm, index) => drawAlarm(list.children[index], alarm));
  setText($("alarms-sound"), t(soundsAlarms() ? "alarms.mute" : "alarms.unmute"));
}

function makeAlarm() {
  const seen = make("button", { type: "button", "data-needs": "operate", onclick: () => void acknowledge(Number(seen.value)) });
  return make("li", {}, icon("warning"), make("div", {}, make("strong"), make("p"), make("small")), seen);
}

/**
 * Say that an alarm is seen: it becomes small, and is silent, on all pages.
 *
 * @param {number} number
 */
async function acknowledge(number) {
  const status = await attempt(() => call("POST", `alarms/${number}/acknowledge`));
  if (status) update({ status });
}

/**
 * @param {HTMLElement} line
 * @param {Alarm} alarm
 */
function drawAlarm(line, { number, statement, since, acknowledged }) {
  const { text, advice } = say(statement);
  const [what, todo, when] = /** @type {HTMLElement[]} */ ([...line.children[1].children]);
  line.dataset.level = statement.level;
  setIcon(line.querySelector("svg"), statement.level);
  setText(what, text);
  setText(todo, advice);
  setText(when, t(acknowledged ? "alarms.seen_since" : "alarms.since", { time: timeOfDay(since) }));
  line.toggleAttribute("data-acknowledged", acknowledged);
  const seen = /** @type {HTMLButtonElement} */ (line.lastElementChild);
  seen.value = String(number);
  seen.hidden = acknowledged;
  setText(seen, t("alarms.acknowledge"));
}
