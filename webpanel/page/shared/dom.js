/** Makes and changes elements of the page. */

const SVG = "http://www.w3.org/2000/svg";
/** The drawings of icons. It stands with this module, at an address that names their version. */
const ICONS = new URL("../icons.svg", import.meta.url).pathname;

/**
 * The element of index.html with this id.
 *
 * @param {string} id
 * @returns {any} HTMLElement; any, because the caller knows which kind it is.
 */
export function $(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`index.html has no element "${id}"`);
  return element;
}

/**
 * Make an element: `make("button", { type: "button", onclick: f }, "text", child)`.
 *
 * @param {string} tag
 * @param {Record<string, any>} properties "class", "data-…", "aria-…", "for" and "role" become attributes.
 * @param {...(Node|string|null)} children
 * @returns {any} HTMLElement
 */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (/^(class|for|role|data-.*|aria-.*)$/.test(name)) element.setAttribute(name, value);
    else /** @type {any} */ (element)[name] = value;
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

/**
 * Make an icon from icons.svg.
 *
 * @param {string} name
 * @returns {SVGSVGElement}
 */
export function icon(name) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  svg.append(document.createElementNS(SVG, "use"));
  setIcon(svg, name);
  return svg;
}

/**
 * Change which drawing an icon shows.
 *
 * @param {Element|null} svg
 * @param {string} name
 */
export function setIcon(svg, name) {
  const use = svg?.querySelector("use");
  const target = `${ICONS}#${name}`;
  if (use && use.getAttribute("href") !== target) use.setAttribute("href", target);
}

/**
 * Make a verdict: mark and words.
 *
 * @param {string} picture
 * @param {string} level
 * @param {string} words
 */
export function makeMark(picture, level, words) {
  return make("span", { class: "mark", "data-level": level }, icon(picture), make("span", {}, words));
}

/**
 * Change a text only if it differs, so that selections and screen readers are not disturbed.
 *
 * @param {Element} element
 * @param {string} text
 */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Fill a <dl> with rows of term and description.
 *
 * @param {Element} list
 * @param {[string, string, string?][]} rows term, description, level of the row (for its colour and mark)
 */
export function fillList(list, rows) {
  if (list.children.length !== rows.length) {
    list.replaceChildren(...rows.map(() => make("div", {}, make("dt"), make("dd"))));
  }
  rows.forEach(([term, description, level = ""], index) => {
    const row = /** @type {HTMLElement} */ (list.children[index]);
    setText(row.children[0], term);
    setText(row.children[1], description);
    row.dataset.level = level;
  });
}
