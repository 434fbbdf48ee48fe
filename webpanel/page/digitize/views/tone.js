/**
 * Brightness, contrast and gamma of the pictures, and their histogram. What is measured in is never changed by them. Pure.
 *
 * @typedef {object} Tone
 * @property {number} brightness -1 to 1: added, as part of the range
 * @property {number} contrast 0.25 to 16: the slope about the middle of the range
 * @property {number} gamma 0.2 to 5: over 1 brightens the dark
 */

/** @param {Tone} tone */
export function isPlain({ brightness, contrast, gamma }) {
  return brightness === 0 && contrast === 1 && gamma === 1;
}

/**
 * What becomes of each grey value.
 *
 * @param {Tone} tone
 * @returns {Uint8ClampedArray} 256 values
 */
export function table({ brightness, contrast, gamma }) {
  return Uint8ClampedArray.from({ length: 256 }, (_, grey) => {
    const line = (grey / 255 - 0.5) * contrast + 0.5 + brightness;
    return 255 * Math.min(1, Math.max(0, line)) ** (1 / gamma);
  });
}

/**
 * Apply a table to the pixels of a grey picture, in place.
 *
 * @param {Uint8ClampedArray} pixels RGBA
 * @param {Uint8ClampedArray} greys 256 values
 */
export function apply(pixels, greys) {
  for (let at = 0; at < pixels.length; at += 4) pixels[at] = pixels[at + 1] = pixels[at + 2] = greys[pixels[at]];
}

/**
 * How often each grey value is there.
 *
 * @param {Uint8ClampedArray} pixels RGBA
 * @returns {Uint32Array} 256 counts
 */
export function histogram(pixels) {
  const counts = new Uint32Array(256);
  for (let at = 0; at < pixels.length; at += 4) counts[pixels[at]] += 1;
  return counts;
}

/**
 * The tone that spreads a picture over the whole range, but for the darkest and brightest of its pixels.
 *
 * @param {Uint32Array} counts
 * @param {number} [share] of the pixels that may be lost at either end
 * @returns {Tone}
 */
export function spread(counts, share = 0.002) {
  const lost = share * counts.reduce((sum, count) => sum + count, 0);
  let [low, high] = [0, 255];
  for (let sum = counts[low]; sum <= lost && low < 254; sum += counts[low]) low += 1;
  for (let sum = counts[high]; sum <= lost && high > low + 1; sum += counts[high]) high -= 1;
  const contrast = Math.min(16, 255 / (high - low));
  return { brightness: contrast * (0.5 - (low + high) / 510), contrast, gamma: 1 };
}
