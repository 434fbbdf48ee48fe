/**
 * Mouse, pen and fingers on the picture of a camera.
 *
 * One finger, the pen or the left button measures; two fingers, the middle button, or the left one while the space key is
 * held move the picture; wheel and two fingers zoom. While a pen is down, fingers do nothing: a palm rests beside it.
 *
 * @typedef {[number, number]} Place CSS px in the canvas
 * @typedef {object} Hand
 * @property {(at: Place, finger: boolean) => void} hover
 * @property {() => void} leave
 * @property {(at: Place, finger: boolean) => void} press
 * @property {(at: Place, finger: boolean, begun: Place) => void} drag
 * @property {(at: Place, begun: Place, path: Place[]) => void} release with the places passed on the way; two or fewer for a click
 * @property {() => void} cancel
 * @property {(dx: number, dy: number) => void} pan
 * @property {(factor: number, at: Place) => void} zoom
 */

const WHEEL_STEP = 0.0018;
/** A hand that moves less than this, CSS px, does not drag: mouse, and finger. */
const [STILL_MOUSE, STILL_FINGER] = [3, 8];

let spaceHeld = false;
addEventListener("keydown", (event) => { if (event.key === " ") spaceHeld = true; });
addEventListener("keyup", (event) => { if (event.key === " ") spaceHeld = false; });
addEventListener("blur", () => { spaceHeld = false; });
/** The pen that is down, in whatever picture. @type {number|null} */
let pen = null;
/** How often one was put down. */
let pens = 0;

/**
 * Where an element is painted, CSS px: on whole pixels of the screen, where the layout has parts of them.
 *
 * @param {HTMLElement} element
 */
export function paintedBox(element) {
  const { left, top, right, bottom } = element.getBoundingClientRect();
  const [x, y, farX, farY] = [left, top, right, bottom].map((edge) => Math.round(edge * devicePixelRatio) / devicePixelRatio);
  return { left: x, top: y, width: farX - x, height: farY - y };
}

/**
 * @param {HTMLElement} canvas
 * @param {Hand} hand
 */
export function watchPointer(canvas, hand) {
  /** @type {Map<number, Place>} */
  const down = new Map();
  /** Before so many pens. @type {{ begun: Place, path: Place[], dragging: boolean, before: number }|null} */
  let measuring = null;

  /** @param {MouseEvent} event @returns {Place} */
  function placeOf(event) {
    const { left, top } = paintedBox(canvas);
    return [event.clientX - left, event.clientY - top];
  }

  /** @param {PointerEvent} event @returns {boolean} whether it was one of those that count */
  function lifted(event) {
    if (event.pointerId === pen) pen = null;
    return down.delete(event.pointerId);
  }

  canvas.addEventListener("pointerdown", (event) => {
    const at = placeOf(event);
    const moving = event.button === 1 || spaceHeld;
    if (!moving && event.button !== 0 || pen !== null) return;
    event.preventDefault();
    if (event.pointerType === "pen") {
      pen = event.pointerId;
      pens += 1;
      if (measuring) hand.cancel();
      down.clear(); // the palm may have come first
    }
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, at);
    if (down.size > 1 || moving) {
      if (measuring) hand.cancel();
      measuring = null;
      return;
    }
    measuring = { begun: at, path: [at], dragging: false, before: pens };
    hand.press(at, event.pointerType === "touch");
  });

  canvas.addEventListener("pointermove", (event) => {
    const [at, before, finger] = [placeOf(event), down.get(event.pointerId), event.pointerType === "touch"];
    if (!before) {
      if (!finger) hand.hover(at, false);
      return;
    }
    const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
    down.set(event.pointerId, at);
    if (measuring) {
      measuring.dragging ||= Math.hypot(at[0] - measuring.begun[0], at[1] - measuring.begun[1]) > (finger ? STILL_FINGER : STILL_MOUSE);
      if (!measuring.dragging) return;
      measuring.path.push(at);
      hand.drag(at, finger, measuring.begun);
    } else if (other) {
      const was = Math.hypot(before[0] - other[0], before[1] - other[1]);
      hand.pan((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
      if (was > 0) hand.zoom(Math.hypot(at[0] - other[0], at[1] - other[1]) / was, [(at[0] + other[0]) / 2, (at[1] + other[1]) / 2]);
    } else hand.pan(at[0] - before[0], at[1] - before[1]);
  });

  canvas.addEventListener("pointerup", (event) => {
    if (!lifted(event) || !measuring) return;
    const { begun, path, dragging, before } = measuring;
    measuring = null;
    if (before !== pens) return hand.cancel(); // it is a palm in another picture
    hand.release(dragging ? placeOf(event) : begun, begun, dragging ? path : [begun]);
    if (event.pointerType === "touch") hand.leave();
  });

  canvas.addEventListener("pointercancel", (event) => {
    if (!lifted(event)) return;
    measuring = null;
    hand.cancel();
  });

  canvas.addEventListener("pointerleave", (event) => { if (!down.has(event.pointerId)) hand.leave(); });

  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    hand.zoom(Math.exp(-event.deltaY * WHEEL_STEP), placeOf(event));
  }, { passive: false });
}
