/** How the rig is: the figures that an operator watches, and a card for each camera that says what to do. */

import { say, t } from "../i18n/i18n.js";
import { $, fillList, icon, make, setIcon, setText } from "../shared/dom.js";
import { number, quantity } from "../shared/format.js";
import { known, watch } from "../shared/store.js";

/** @typedef {import("../shared/types.js").CameraStatus} CameraStatus */

const FEW_JUMPS = 20;

export function startHealth() {
  watch(drawVitals);
  watch(drawCameras);
}

/** Pulses, seconds kept in memory, space left on the disk, warmest camera. */
function drawVitals() {
  const { status } = known;
  if (!status) return;
  const { pulses, preroll, disk, state } = status;
  const on = state === "armed" || state === "recording";
  const warmest = Math.max(...status.cameras.map((camera) => camera.temperature_c ?? -Infinity));
  fillList($("vitals"), [
    [t("vitals.pulses"), pulses.arriving ? quantity(pulses.rate_hz, 1, "/s") : t(on ? "vitals.none" : "vitals.off"), on && !pulses.arriving ? "warning" : ""],
    [t("vitals.spread"), quantity(pulses.arriving ? pulses.spread_us : null, 1, "µs")],
    [t("vitals.preroll"), quantity(preroll.seconds, 1, "s")],
    [t("vitals.jumps"), number(disk.jumps_left), disk.jumps_left < 1 ? "error" : disk.jumps_left < FEW_JUMPS ? "warning" : ""],
    [t("vitals.free"), quantity(disk.free_gb, 0, "GB")],
    [t("vitals.warmest"), Number.isFinite(warmest) ? quantity(warmest, 0, "°C") : "–"],
  ]);
}

function drawCameras() {
  const cameras = known.status?.cameras ?? [];
  const list = $("cameras");
  if (list.children.length !== cameras.length) list.replaceChildren(...cameras.map(makeCard));
  cameras.forEach((camera, index) => drawCard(list.children[index], camera));
}

function makeCard() {
  return make("li", { class: "camera" },
    icon("info"),
    make("div", { class: "camera-head" }, make("strong"), make("span", { class: "camera-state" })),
    make("p", { class: "camera-text" }), make("p", { class: "advice" }), make("p", { class: "camera-facts" }));
}

/**
 * @param {HTMLElement} card
 * @param {CameraStatus} camera
 */
function drawCard(card, camera) {
  const { text, advice } = say(camera.statement);
  card.dataset.level = camera.statement.level;
  setIcon(card.querySelector("svg"), camera.statement.level);
  const [head, words, todo, facts] = /** @type {HTMLElement[]} */ ([...card.children].slice(1));
  setText(head.children[0], camera.name);
  setText(head.children[1], t(`camera.${camera.state}`));
  setText(words, text);
  words.hidden = camera.state === "ready" && camera.statement.level === "good"; // the head says it
  setText(todo, advice);
  todo.hidden = !advice;
  setText(facts, factsOf(camera));
}

/** @param {CameraStatus} camera */
function factsOf(camera) {
  const facts = [];
  if (camera.frames_per_s !== null) facts.push(t("camera.rate", { rate: number(camera.frames_per_s, 1) }));
  if (camera.temperature_c !== null) facts.push(quantity(camera.temperature_c, 0, "°C"));
  if (camera.clock_offset_us !== null) facts.push(t("camera.offset", { offset: number(camera.clock_offset_us, 1) }));
  if (camera.damaged) facts.push(t("camera.damaged", { count: camera.damaged }));
  if (camera.resent_packets) facts.push(t("camera.resent", { count: camera.resent_packets }));
  if (camera.reconnects) facts.push(t("camera.reconnects", { count: camera.reconnects }));
  const { late = 0, refused = 0, unanswered = 0 } = camera.actions ?? {};
  if (late || refused || unanswered) facts.push(t("camera.actions", { late, refused, unanswered }));
  return facts.join("  ·  ") || camera.address;
}
