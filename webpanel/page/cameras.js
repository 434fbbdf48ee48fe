/** A card for each camera: how it is, in plain words, and what to do. */

import { $, icon, make, setIcon, setText } from "./dom.js";
import { number, quantity } from "./format.js";
import { say, t } from "./i18n.js";
import { known, watch } from "./store.js";

/** @typedef {import("./types.js").CameraStatus} CameraStatus */

export function startCameras() {
  watch(draw);
}

function draw() {
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
  return facts.join("  ·  ") || camera.address;
}
