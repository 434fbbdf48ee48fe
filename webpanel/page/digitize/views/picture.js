/** Brightness, contrast and gamma of the pictures, and the histogram of the active view. */

import { $ } from "../../shared/dom.js";
import { change, PLAIN, state, watch } from "../session/state.js";
import { pageColour } from "./colour.js";
import { frameOf } from "./frames.js";
import { spread, table } from "./tone.js";

const PARTS = /** @type {const} */ (["brightness", "contrast", "gamma"]);

export function startPicture() {
  for (const part of PARTS) {
    const slider = $(`tone-${part}`);
    slider.addEventListener("input", () => {
      const value = Number(slider.value);
      change({ tone: { ...state.tone, [part]: part === "brightness" ? value : 2 ** value } });
    });
  }
  $("tone-auto").addEventListener("click", spreadTone);
  $("tone-plain").addEventListener("click", () => change({ tone: PLAIN }));
  $("picture").addEventListener("toggle", () => change({}));
  watch(draw);
}

/** Spread the picture of the active view over the whole range. */
export function spreadTone() {
  const counts = frameOf(state.camera, true)?.counts;
  if (counts) change({ tone: spread(counts) });
}

function draw() {
  for (const part of PARTS) {
    const value = state.tone[part];
    if (document.activeElement !== $(`tone-${part}`)) $(`tone-${part}`).value = String(part === "brightness" ? value : Math.log2(value));
  }
  const counts = $("picture").open ? frameOf(state.camera, true)?.counts : null;
  const canvas = $("histogram");
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  if (!counts) return;
  const most = Math.log1p(Math.max(...counts));
  context.fillStyle = pageColour(canvas, "--quiet");
  counts.forEach((count, grey) => {
    const tall = height * Math.log1p(count) / most;
    context.fillRect(grey * width / 256, height - tall, width / 256, tall);
  });
  context.strokeStyle = pageColour(canvas, "--accent");
  context.lineWidth = 2;
  context.beginPath();
  table(state.tone).forEach((value, grey) => { context.lineTo((grey + 0.5) * width / 256, height * (1 - value / 255)); });
  context.stroke();
}
