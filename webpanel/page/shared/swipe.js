/** A finger that goes sideways over an element: to what comes next, or before. */

/** It goes at least so far, CSS px. */
const SWIPE_PX = 40;

/**
 * @param {HTMLElement} element that scrolls up and down only (`touch-action: pan-y`)
 * @param {(step: 1|-1) => void} swiped 1: the finger went to the left, so that the next one comes
 */
export function onSwipe(element, swiped) {
  /** Where the finger was put down; null: it was not, or there are two. @type {{ x: number, y: number }|null} */
  let begun = null;

  element.addEventListener("pointerdown", (event) => {
    begun = event.pointerType === "mouse" || !event.isPrimary ? null : { x: event.clientX, y: event.clientY };
  });

  element.addEventListener("pointerup", (event) => {
    const pixels = begun ? event.clientX - begun.x : 0;
    begun = null;
    if (Math.abs(pixels) >= SWIPE_PX) swiped(pixels < 0 ? 1 : -1);
  });

  // Otherwise the browser takes the swipe for a scroll of its own, and a tap soon after it for the end of that.
  element.addEventListener("touchmove", (event) => {
    const { clientX, clientY } = event.touches[0];
    if (begun && event.cancelable && Math.abs(clientX - begun.x) > Math.abs(clientY - begun.y)) event.preventDefault();
  }, { passive: false });
}
