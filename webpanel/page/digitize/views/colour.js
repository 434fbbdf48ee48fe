/** Colours of the page on a canvas, which knows no variables of the style sheets. */

/**
 * @param {HTMLElement} element in whose place the variable is looked up
 * @param {string} name of the variable, such as "--accent"
 * @returns {string} a colour that a canvas takes
 */
export function pageColour(element, name) {
  element.style.color = `var(${name})`;
  return getComputedStyle(element).color;
}
