/**
 * Second taps: for a moment after each change of state the big button waits, and shows it; in the first seconds of a
 * recording only a long press stops it. The service refuses what gets through all the same (see `seen` there).
 */

import { known, watch } from "../shared/store.js";

const TICK_MS = 100;
/** How long a button is to be pressed to stop a recording that has only just begun. */
const LONG_PRESS_MS = 700;

let number = -1;
/** On this page's clock, ms: until when the button waits, and until when stopping needs a long press. */
let waitsUntil = 0;
let confirmUntil = 0;
let ticking = 0;

/**
 * Follow the state, and draw while something counts down.
 *
 * @param {() => void} draw
 */
export function startTaps(draw) {
  watch(() => {
    const guard = known.status?.guard;
    if (guard && guard.number !== number) {
      number = guard.number;
      waitsUntil = known.heard + 1000 * guard.hold_s;
      confirmUntil = known.heard + 1000 * guard.confirm_s;
    }
    if (!ticking && left(Math.max(waitsUntil, confirmUntil))) {
      ticking = setInterval(() => {
        draw();
        if (!left(Math.max(waitsUntil, confirmUntil))) {
          clearInterval(ticking);
          ticking = 0;
        }
      }, TICK_MS);
    }
  });
}

/** Number of the state that the page shows: sent with every command that a button gives. */
export function seen() {
  return number;
}

/** Seconds until the button takes a tap. */
export function waits() {
  return left(waitsUntil) / 1000;
}

/** Whether stopping needs a long press. */
export function wantsLongPress() {
  return left(confirmUntil) > 0;
}

/** @param {number} until */
function left(until) {
  return Math.max(0, until - Date.now());
}

/**
 * Tell a long press on a button from a tap.
 *
 * @param {HTMLElement} button gets the class "pressed" meanwhile, by which it shows how far the press is
 * @param {() => boolean} wanted
 * @param {() => void} done
 */
export function onLongPress(button, wanted, done) {
  let timer = 0;
  let fired = false;
  const end = () => {
    clearTimeout(timer);
    button.classList.remove("pressed");
  };
  button.addEventListener("pointerdown", (event) => {
    end();
    fired = false;
    if (!wanted()) return;
    // What appears or goes above the button must not move it away from the finger.
    button.setPointerCapture(event.pointerId);
    button.classList.add("pressed");
    timer = setTimeout(() => { end(); fired = true; done(); }, LONG_PRESS_MS);
  });
  for (const name of ["pointerup", "pointercancel", "blur"]) button.addEventListener(name, end);
  button.addEventListener("click", (event) => {
    if (fired) event.stopImmediatePropagation(); // the end of the long press is no tap on the next step
    fired = false;
  }, { capture: true });
  button.addEventListener("contextmenu", (event) => event.preventDefault()); // a phone's menu for a long press
}
