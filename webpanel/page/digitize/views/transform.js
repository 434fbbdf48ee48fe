/**
 * From places in an image to places on the screen and back. Pure functions.
 *
 * Image: px, (0, 0) is the centre of the top-left pixel. Screen: CSS px from the top-left corner of the canvas.
 *
 * @typedef {[number, number]} Place
 * @typedef {object} Lens how an image is looked at
 * @property {number} scale CSS px for one px of the image
 * @property {number} x the place of the image that is in the middle of the canvas, px
 * @property {number} y
 * @typedef {[number, number]} Size width and height
 */

/** Screen px for one px of the image, at most. */
export const LARGEST = 32;
/** From this scale on, pixels are squares. */
export const CRISP = 3;

/**
 * The whole image, as large as it fits.
 *
 * @param {Size} image
 * @param {Size} box the canvas, CSS px
 * @returns {Lens}
 */
export function whole([width, height], box) {
  return { scale: Math.min(LARGEST, box[0] / width, box[1] / height) || 1, x: (width - 1) / 2, y: (height - 1) / 2 };
}

/**
 * @param {Lens} lens
 * @param {Size} box
 * @param {Place} place in the image
 * @returns {Place} on the screen
 */
export function toScreen({ scale, x, y }, box, place) {
  return [(place[0] - x) * scale + box[0] / 2, (place[1] - y) * scale + box[1] / 2];
}

/**
 * @param {Lens} lens
 * @param {Size} box
 * @param {Place} at on the screen
 * @returns {Place} in the image
 */
export function toImage({ scale, x, y }, box, at) {
  return [(at[0] - box[0] / 2) / scale + x, (at[1] - box[1] / 2) / scale + y];
}

/**
 * Keep the scale between the whole image (or 1, if that is less) and the largest, and the middle inside of the image.
 *
 * @param {Lens} lens
 * @param {Size} image
 * @param {Size} box
 * @returns {Lens}
 */
export function bounded({ scale, x, y }, image, box) {
  const least = Math.min(1, whole(image, box).scale);
  return {
    scale: Math.min(LARGEST, Math.max(least, scale)),
    x: Math.min(image[0] - 0.5, Math.max(-0.5, x)),
    y: Math.min(image[1] - 0.5, Math.max(-0.5, y)),
  };
}

/**
 * Zoom; what is at `at` stays there.
 *
 * @param {Lens} lens
 * @param {Size} image
 * @param {Size} box
 * @param {number} factor
 * @param {Place} [at] on the screen; the middle
 * @returns {Lens}
 */
export function zoomed(lens, image, box, factor, at = [box[0] / 2, box[1] / 2]) {
  const { scale } = bounded({ ...lens, scale: lens.scale * factor }, image, box);
  const [x, y] = toImage(lens, box, at);
  return bounded({ scale, x: x - (at[0] - box[0] / 2) / scale, y: y - (at[1] - box[1] / 2) / scale }, image, box);
}

/**
 * @param {Lens} lens
 * @param {Size} image
 * @param {Size} box
 * @param {number} dx how far the image moves on the screen, CSS px
 * @param {number} dy
 * @returns {Lens}
 */
export function moved(lens, image, box, dx, dy) {
  return bounded({ ...lens, x: lens.x - dx / lens.scale, y: lens.y - dy / lens.scale }, image, box);
}
