/**
 * Zooms and pans a picture with wheel, two fingers, drag or buttons.
 *
 * @typedef {object} Pan
 * @property {(factor: number) => void} zoom about the middle
 * @property {() => void} reset
 */

const LARGEST = 8;
const WHEEL_STEP = 0.0018;
/** A touch that moves less than this is a tap. */
const TAP_PX = 6;

/**
 * @param {HTMLElement} frame stays in place
 * @param {HTMLElement} plane is moved and scaled in it
 * @returns {Pan}
 */
export function makePan(frame, plane) {
  let scale = 1;
  let x = 0;
  let y = 0;
  /** @type {Map<number, { x: number, y: number }>} */
  const fingers = new Map();
  let moved = 0;

  function draw() {
    scale = Math.min(Math.max(1, scale), LARGEST);
    x = Math.min(0, Math.max(frame.clientWidth * (1 - scale), x));
    y = Math.min(0, Math.max(frame.clientHeight * (1 - scale), y));
    plane.style.transform = `translate(${x}px, ${y}px) scale(${scale})`;
    frame.classList.toggle("zoomed", scale > 1);
    frame.style.setProperty("--zoom", String(scale));
  }

  /**
   * @param {number} factor
   * @param {number} centreX
   * @param {number} centreY in the frame, px
   */
  function zoomAbout(factor, centreX, centreY) {
    const before = scale;
    scale = Math.min(Math.max(1, scale * factor), LARGEST);
    x = centreX - (centreX - x) * (scale / before);
    y = centreY - (centreY - y) * (scale / before);
    draw();
  }

  /** @param {MouseEvent} event @returns {[number, number]} */
  function inside(event) {
    const box = frame.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  frame.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoomAbout(Math.exp(-event.deltaY * WHEEL_STEP), ...inside(event));
  }, { passive: false });

  frame.addEventListener("pointerdown", (event) => {
    if (!fingers.size) moved = 0;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });

  frame.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
    moved += Math.hypot(dx, dy);
    if (moved > TAP_PX && !frame.hasPointerCapture(event.pointerId)) frame.setPointerCapture(event.pointerId);
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (other) {
      const was = Math.hypot(before.x - other.x, before.y - other.y);
      const box = frame.getBoundingClientRect();
      const [middleX, middleY] = [(event.clientX + other.x) / 2 - box.left, (event.clientY + other.y) / 2 - box.top];
      if (was > 0) zoomAbout(Math.hypot(event.clientX - other.x, event.clientY - other.y) / was, middleX, middleY);
    } else if (moved > TAP_PX) {
      [x, y] = [x + dx, y + dy];
      draw();
    }
  });

  for (const end of ["pointerup", "pointercancel"]) {
    frame.addEventListener(end, (event) => { fingers.delete(/** @type {PointerEvent} */ (event).pointerId); });
  }

  // The click at the end of a drag must not select a camera.
  frame.addEventListener("click", (event) => {
    if (moved > TAP_PX) event.stopPropagation();
    moved = 0;
  }, { capture: true });

  return {
    zoom: (factor) => zoomAbout(factor, frame.clientWidth / 2, frame.clientHeight / 2),
    reset() {
      [scale, x, y] = [1, 0, 0];
      draw();
    },
  };
}
