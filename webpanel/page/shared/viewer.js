/**
 * Shows a triplet: all cameras side by side, or one of them large. (pan.js zooms and pans it.)
 *
 * @typedef {object} Block one camera's part of the triplet
 * @property {string} name
 * @property {[number, number]} columns first and one past the last
 *
 * @typedef {object} Viewer
 * @property {HTMLImageElement} image
 * @property {HTMLElement} plane what zoom and pan move
 * @property {SVGSVGElement} over lies on the image; its units are px of the image, (0, 0) is the outer corner
 * @property {(blocks: Block[], rows: number) => void} layOut
 * @property {(index: number|null) => void} select one camera, or all
 * @property {() => number|null} selected
 * @property {(index: number, level: string, title: string, text: string, advice: string) => void} cover put words over a camera's block that say why it is black; no title: take them away
 */

import { t } from "../i18n/i18n.js";
import { make, setText } from "./dom.js";

/**
 * @param {HTMLElement} root
 * @param {(index: number|null) => void} chosen called when a camera is tapped
 * @returns {Viewer}
 */
export function makeViewer(root, chosen) {
  const image = make("img", { alt: "", draggable: false });
  const over = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  over.setAttribute("preserveAspectRatio", "none");
  over.setAttribute("aria-hidden", "true");
  const plane = make("div", { class: "plane" }, image, over);
  const labels = make("div", { class: "labels" });
  root.append(plane, labels);
  /** @type {Block[]} */
  let blocks = [];
  let rows = 1;
  /** @type {number|null} */
  let one = null;

  function draw() {
    const all = blocks.at(-1)?.columns[1] ?? 1;
    const [left, right] = one === null ? [0, all] : blocks[one].columns;
    root.style.aspectRatio = `${right - left} / ${rows}`;
    root.classList.toggle("single", one !== null);
    over.setAttribute("viewBox", `0 0 ${all} ${rows}`);
    for (const { style } of [image, over]) {
      style.width = `${(100 * all) / (right - left)}%`;
      style.left = `${(-100 * left) / (right - left)}%`;
    }
    blocks.forEach((block, index) => {
      const label = labels.children[index];
      label.hidden = one !== null && one !== index;
      label.style.left = one === null ? `${(100 * block.columns[0]) / all}%` : "0";
      label.style.width = one === null ? `${(100 * (block.columns[1] - block.columns[0])) / all}%` : "100%";
      setText(label.querySelector(".unseen"), t(one === null ? "viewer.enlarge" : "viewer.all"));
      label.setAttribute("aria-pressed", String(one === index));
    });
  }

  return {
    image,
    plane,
    over,
    layOut(newBlocks, newRows) {
      if (newBlocks.map((block) => block.name).join() !== blocks.map((block) => block.name).join()) {
        one = null;
        labels.replaceChildren(...newBlocks.map((block, index) => make(
          "button", { type: "button", class: "block", onclick: () => chosen(one === null ? index : null) },
          make("span", { class: "name" }, block.name), make("span", { class: "unseen" }), make("span", { class: "cover", hidden: true }),
        )));
      }
      [blocks, rows] = [newBlocks, newRows];
      draw();
    },
    select(index) {
      one = index !== null && index < blocks.length ? index : null;
      draw();
    },
    selected: () => one,
    cover(index, level, title, text, advice) {
      const cover = labels.children[index].querySelector(".cover");
      cover.hidden = !title;
      cover.dataset.level = level;
      if (!cover.children.length) cover.append(make("strong"), make("span"), make("em"));
      [title, text, advice].forEach((words, line) => setText(cover.children[line], words));
    },
  };
}
