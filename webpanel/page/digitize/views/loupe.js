/** The loupe: what is under the pointer, enlarged, beside it; above a finger. */

import { state } from "../session/state.js";

/** Its radius, CSS px, and at most such a part of the view. */
const [RADIUS, PART] = [76, 0.32];
/** How far from the pointer its middle is, as a part of its radius: so that it hides neither place nor finger. */
const AWAY = 1.45;

/**
 * @param {CanvasRenderingContext2D} context in CSS px
 * @param {object} seen
 * @param {CanvasImageSource} seen.picture
 * @param {[number, number]} seen.xy place in the image, in the middle of the loupe
 * @param {[number, number]} seen.at the same on the canvas
 * @param {[number, number]} seen.box size of the canvas
 * @param {number} seen.scale CSS px for one px of the image, in the view
 * @param {boolean} seen.finger
 * @param {(context: CanvasRenderingContext2D, project: (place: [number, number]) => [number, number]) => void} overlay
 */
export function drawLoupe(context, { picture, xy, at, box, scale, finger }, overlay) {
  if (!state.loupe || scale >= state.loupe) return;
  const radius = Math.min(RADIUS, PART * Math.min(...box));
  const [x, y] = middle(at, box, radius, finger);
  const large = state.loupe;
  context.save();
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = "#05090e";
  context.fill();
  context.clip();
  context.save();
  context.translate(x, y);
  context.scale(large, large);
  context.translate(-xy[0], -xy[1]);
  context.imageSmoothingEnabled = false;
  context.drawImage(picture, -0.5, -0.5);
  context.restore();
  overlay(context, (place) => [x + (place[0] - xy[0]) * large, y + (place[1] - xy[1]) * large]);
  context.restore();
  context.lineWidth = 1;
  context.strokeStyle = "#ffffff";
  context.beginPath();
  for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
    context.moveTo(x + 4 * dx, y + 4 * dy);
    context.lineTo(x + 0.5 * radius * dx, y + 0.5 * radius * dy);
  }
  context.stroke();
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.lineWidth = 2;
  context.stroke();
}

/**
 * @param {[number, number]} at
 * @param {[number, number]} box
 * @param {number} radius
 * @param {boolean} finger above it if there is room, else beside it; of a mouse: to the upper right
 * @returns {[number, number]}
 */
function middle([x, y], [width, height], radius, finger) {
  const away = AWAY * radius;
  const right = x + away + radius < width;
  if (finger && y - away - radius > 0) return [Math.min(width - radius, Math.max(radius, x)), y - away];
  return [Math.min(width - radius, Math.max(radius, right ? x + away : x - away)), finger || y - away > radius ? Math.max(radius, y - (finger ? 0 : away)) : Math.min(height - radius, y + away)];
}
