/** The strip below the slider: one line per camera, one stroke per pulse; a gap is tall and has its cause's colour. */

import { make } from "./dom.js";
import { t } from "./i18n.js";

/** @typedef {import("./types.js").Pulses} Pulses */

const LINE_PX = 18;
/** From harmless to grave: where several pulses share a px, the gravest is seen. */
const GRAVITY = ["ok", "missed", "lost", "damaged", "absent"];

/**
 * @param {HTMLElement} strip
 * @param {(index: number) => void} sought called with the index of the pulse that was pointed at
 */
export function makeStrip(strip, sought) {
  strip.append(make("div", { class: "strip-names" }), make("div", { class: "strip-lines" }, make("canvas", { role: "img" }), make("i")), make("ul", { class: "strip-key" }));
  const lines = /** @type {HTMLElement} */ (strip.children[1]);
  /** @param {PointerEvent} event */
  const seek = (event) => {
    const box = lines.getBoundingClientRect();
    sought(Math.floor(((event.clientX - box.left) / box.width) * Number(strip.dataset.pulses)));
  };
  lines.addEventListener("pointerdown", (event) => { lines.setPointerCapture(event.pointerId); seek(event); });
  lines.addEventListener("pointermove", (event) => { if (lines.hasPointerCapture(event.pointerId)) seek(event); });
}

/**
 * @param {HTMLElement} strip
 * @param {Pulses} recording
 */
export function drawStrip(strip, { cameras, pulses }) {
  strip.dataset.pulses = String(pulses.length);
  const [names, lines, key] = strip.children;
  names.replaceChildren(...cameras.map((name) => make("span", {}, name)));
  const found = GRAVITY.filter((status) => pulses.some(({ statuses }) => statuses.includes(status)));
  key.replaceChildren(...found.map((status) => make("li", { "data-status": status }, t(`status.${status}`))));
  const canvas = /** @type {HTMLCanvasElement} */ (lines.querySelector("canvas"));
  const gaps = pulses.filter(({ statuses }) => statuses.some((status) => status !== "ok")).length;
  canvas.setAttribute("aria-label", t("scrub.strip", { gaps, pulses: pulses.length }));
  paint(canvas, cameras.length, pulses.map(({ statuses }) => statuses));
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {number} cameras
 * @param {string[][]} fates by pulse and camera
 */
function paint(canvas, cameras, fates) {
  const sharp = devicePixelRatio;
  const width = Math.round((canvas.clientWidth || 1) * sharp);
  canvas.width = width;
  canvas.height = cameras * LINE_PX * sharp;
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const colours = getComputedStyle(canvas);
  for (let camera = 0; camera < cameras; camera += 1) {
    const columns = gravestByColumn(fates, camera, width);
    columns.forEach((status, column) => {
      const fine = status === "ok";
      const height = (fine ? 5 : LINE_PX - 4) * sharp;
      pen.fillStyle = colours.getPropertyValue(`--status-${status}`);
      pen.fillRect(column, camera * LINE_PX * sharp + (LINE_PX * sharp - height) / 2, 1, height);
    });
  }
}

/**
 * @param {string[][]} fates
 * @param {number} camera
 * @param {number} width px
 */
function gravestByColumn(fates, camera, width) {
  const columns = Array(width).fill("ok");
  fates.forEach((statuses, index) => {
    const status = statuses[camera];
    if (status === "ok") return;
    const first = Math.floor((index * width) / fates.length);
    const end = Math.max(first + 3, Math.floor(((index + 1) * width) / fates.length)); // thin ones shall be seen
    for (let column = first; column < Math.min(end, width); column += 1) {
      if (GRAVITY.indexOf(status) > GRAVITY.indexOf(columns[column])) columns[column] = status;
    }
  });
  return columns;
}
