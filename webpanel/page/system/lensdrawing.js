/** Drawings of the calibration helper: parts of the picture that are covered, found corners, mean residuals. */

const SVG = "http://www.w3.org/2000/svg";
/** The longest residual is drawn as this part of the picture's width. */
const LONGEST = 0.07;

/** @typedef {import("./types.js").SeenTarget} SeenTarget */

/**
 * Draw which parts of the picture are covered, and the corners that were found last.
 *
 * @param {Element} svg
 * @param {SeenTarget} seen
 * @param {boolean} found whether to draw the corners
 */
export function drawCovered(svg, { width, height, cells, corners }, found) {
  frame(svg, width, height);
  const [rows, columns] = [cells.length, cells[0]?.length ?? 0];
  const parts = cells.flatMap((row, y) => row.map((count, x) => shape("rect", {
    class: count ? "has" : "none", x: x * width / columns - 0.5, y: y * height / rows - 0.5, width: width / columns, height: height / rows,
  })));
  const dots = found ? corners.map(([x, y]) => shape("circle", { cx: x, cy: y, r: width / 110 })) : [];
  svg.replaceChildren(...parts, ...dots);
}

/**
 * Draw mean residuals as lines that begin in a dot.
 *
 * @param {Element} svg
 * @param {{ width: number, height: number }} size
 * @param {[number, number, number, number][]} residuals
 * @returns {{ times: number, longest: number }} how much they are enlarged, and how long the longest is, px
 */
export function drawResiduals(svg, { width, height }, residuals) {
  frame(svg, width, height);
  const longest = Math.max(1e-6, ...residuals.map(([, , dx, dy]) => Math.hypot(dx, dy)));
  const times = Number((LONGEST * width / longest).toPrecision(1));
  svg.replaceChildren(...residuals.flatMap(([x, y, dx, dy]) => [
    shape("line", { class: "arrow", x1: x, y1: y, x2: x + times * dx, y2: y + times * dy }),
    shape("circle", { class: "foot", cx: x, cy: y, r: width / 160 }),
  ]));
  return { times, longest };
}

/**
 * @param {Element} svg
 * @param {number} width
 * @param {number} height
 */
function frame(svg, width, height) {
  svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
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
