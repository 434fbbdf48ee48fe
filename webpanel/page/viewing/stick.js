/**
 * The stick figure of the measured jumper over the picture in sight, where that picture shows him.
 *
 * @typedef {[number, number]} Place px in the camera's own image, (0, 0) in the centre of its first pixel
 *
 * @typedef {object} Seen what one camera shows of the jumper at a pulse
 * @property {Record<string, Place[]>} lines body (helmet, hip, bindings), feet, right and left ski from tail to tip
 * @property {Record<string, Place>} points P1 helmet, P2 hip, P3 right and P4 left binding
 *
 * @typedef {object} Drawn what is drawn at one pulse
 * @property {number} pulse
 * @property {number} since_s after the take-off
 * @property {number|null} distance_m along the flight
 * @property {boolean} smoothed by the model over time; otherwise by this pulse alone
 * @property {boolean} unsure
 * @property {Record<string, string>} status of each point, e.g. "predicted": nobody saw it
 * @property {Record<string, Seen>} images by camera
 *
 * @typedef {object} Curve
 * @property {string} name
 * @property {"m"|"m/s"|"°"} unit
 * @property {number} least range of values
 * @property {(number|null)[]} value one a pulse
 * @property {(number|null)[]} sigma
 *
 * @typedef {object} Jump as in overlay.json, which the analysis writes
 * @property {number} number
 * @property {{ pulse: number, sigma_pulses: number }|null} takeoff
 * @property {Drawn[]} pulses
 * @property {Curve[]} curves
 */

import { $ } from "../shared/dom.js";
import { load, save } from "../shared/store.js";
import { onPictured, pictured } from "./scrubber.js";

/** @typedef {import("../shared/viewer.js").Block} Block */

const SVG = "http://www.w3.org/2000/svg";
/** The centre of the first pixel lies half a pixel within the picture. */
const HALF_PX = 0.5;

/** By pulse. @type {Map<number, Drawn>} */
let drawn = new Map();
let wanted = true;

export function startStick() {
  wanted = load("stick", true);
  $("frame-stick").addEventListener("click", () => {
    wanted = !wanted;
    save("stick", wanted);
    draw();
  });
  onPictured(draw);
}

/**
 * Draw the stick figures of these jumps from now on.
 *
 * @param {Jump[]} jumps none: nothing is drawn
 */
export function showSticks(jumps) {
  drawn = new Map(jumps.flatMap(({ pulses }) => pulses.map((each) => [each.pulse, each])));
  $("frame-stick").hidden = drawn.size === 0;
  draw();
}

function draw() {
  $("frame-stick").setAttribute("aria-pressed", String(wanted));
  const { over, pulse, blocks, rows } = pictured();
  const now = wanted && pulse !== null ? drawn.get(pulse) : undefined;
  over.replaceChildren(...now ? blocks.flatMap((block) => now.images[block.name] ? [makeFigure(now.images[block.name], now, block, rows)] : []) : []);
}

/**
 * The figure in one camera's part of the triplet; what lies outside that part is cut off.
 *
 * @param {Seen} seen
 * @param {Drawn} now
 * @param {Block} block
 * @param {number} rows
 */
function makeFigure({ lines, points }, { status, smoothed, unsure }, { name, columns }, rows) {
  const [left, right] = columns;
  const part = shape("svg", { x: left, y: 0, width: right - left, height: rows, viewBox: `0 0 ${right - left} ${rows}`, class: smoothed && !unsure ? "stick" : "stick unsure", "data-camera": name });
  for (const [of, line] of Object.entries(lines)) {
    const path = `M${line.map(written).join("L")}`;
    part.append(shape("path", { d: path, class: "halo" }), shape("path", { d: path, class: of }));
  }
  for (const [of, place] of Object.entries(points)) {
    const dot = `M${written(place)}h0`; // a line without length: its round ends are as large at every zoom
    part.append(shape("path", { d: dot, class: "halo dot" }), shape("path", { d: dot, class: `dot ${of}` }));
    if (status[of] === "predicted") part.append(shape("path", { d: dot, class: "hole" }));
  }
  return part;
}

/** @param {Place} place */
function written([x, y]) {
  return `${x + HALF_PX} ${y + HALF_PX}`;
}

/**
 * @param {string} tag
 * @param {Record<string, string|number>} attributes
 */
function shape(tag, attributes) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  return made;
}
