// Lets people step through the pulses of a jump: three views, stick figure, numbers, and a mark in every chart.
"use strict";

(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const UNITS_PER_M = 92;
  const MIDDLE = [160, 150];
  const SLOW_MOTION_MS = 110;
  const DEGREE = Math.PI / 180;

  /** @type {Record<string, { play: string, pause: string, pulse: string }>} */
  const WORDS = { en: { play: "Play", pause: "Pause", pulse: "pulse" }, nb: { play: "Spill av", pause: "Pause", pulse: "puls" } };
  let language = "en";

  /** @param {string} text numbers and units, as they are written in English */
  const local = (text) => (language === "nb" ? text.replace(/(\d)\.(?=\d)/g, "$1,").replace("pulse", WORDS.nb.pulse) : text);

  /** @param {string} name @param {Record<string, string | number>} attributes */
  function shape(name, attributes) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
    return made;
  }

  /** @param {ParentNode} parent @param {string} selector @returns {any} */
  const one = (parent, selector) => parent.querySelector(selector);
  /** @param {ParentNode} parent @param {string} selector @returns {any[]} */
  const all = (parent, selector) => [...parent.querySelectorAll(selector)];

  /** The stick figure: orthographic, turned about the vertical and then tilted; degrees. */
  class Stick {
    /** @param {HTMLElement} figure */
    constructor(figure) {
      this.svg = one(figure, "svg");
      this.buttons = all(figure, "button");
      this.turn = [0, 0];
      /** @type {Record<string, number[][]>} */
      this.lines = {};
      for (const button of this.buttons) {
        button.addEventListener("click", () => this.look(button.dataset.turn.split(",").map(Number)));
      }
      /** @type {number[] | null} */
      let from = null;
      this.svg.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
        from = [event.clientX, event.clientY, ...this.turn];
        this.svg.setPointerCapture(event.pointerId);
      });
      this.svg.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
        if (!from) return;
        const tilt = from[3] + (event.clientY - from[1]) / 2;
        this.look([from[2] - (event.clientX - from[0]) / 2, Math.max(-20, Math.min(90, tilt))]);
      });
      for (const end of ["pointerup", "pointercancel"]) this.svg.addEventListener(end, () => (from = null));
    }

    /** @param {number[]} turn */
    look(turn) {
      this.turn = turn;
      this.draw();
    }

    /** @param {number[]} place along the flight, to the left, up; m */
    project([along, left, up]) {
      const [a, e] = this.turn.map((angle) => angle * DEGREE);
      const aside = along * Math.cos(a) - left * Math.sin(a);
      const away = along * Math.sin(a) + left * Math.cos(a);
      const high = up * Math.cos(e) + away * Math.sin(e);
      return [MIDDLE[0] + UNITS_PER_M * aside, MIDDLE[1] - UNITS_PER_M * high];
    }

    draw() {
      /** @param {number[][]} line */
      const points = (line) => line.map((place) => this.project(place).map((v) => v.toFixed(1)).join(",")).join(" ");
      const parts = [shape("polyline", { class: "level", points: points([[-1.5, 0, 0], [1.5, 0, 0]]) })];
      for (const name of ["left", "feet", "right", "body"]) {
        if (name in this.lines) parts.push(shape("polyline", { class: name, points: points(this.lines[name]) }));
      }
      if ("body" in this.lines) {
        const [cx, cy] = this.project(this.lines.body[0]);
        parts.push(shape("circle", { class: "helmet", cx: cx.toFixed(1), cy: cy.toFixed(1), r: 8 }));
      }
      this.svg.replaceChildren(...parts);
      for (const button of this.buttons) {
        button.setAttribute("aria-pressed", String(button.dataset.turn === this.turn.join(",")));
      }
    }
  }

  class Scrubber {
    /** @param {HTMLElement} jump */
    constructor(jump) {
      const root = one(jump, ".scrubber");
      this.frames = JSON.parse(one(root, "script").textContent);
      this.range = one(root, "input[type=range]");
      this.words = one(root, "output");
      this.play = one(root, ".play");
      this.views = all(root, "[data-view]");
      this.table = one(root, ".numbers");
      this.numbers = all(root, "[data-number]");
      this.stick = new Stick(one(root, ".stick"));
      this.timer = 0;
      this.marks = all(jump, ".charts:not(.wide) svg").map((svg) => {
        const mark = shape("line", { class: "mark", y1: 30, y2: svg.viewBox.baseVal.height - 30 });
        svg.append(mark);
        return mark;
      });
      const lines = one(root, ".lines input");
      lines.addEventListener("change", () => root.classList.toggle("bare", !lines.checked));
      this.range.addEventListener("input", () => this.stop());
      this.range.addEventListener("input", () => this.show());
      this.play.addEventListener("click", () => (this.timer ? this.stop() : this.start()));
      one(root, ".back").addEventListener("click", () => this.step(-1));
      one(root, ".on").addEventListener("click", () => this.step(1));
      for (const view of this.views) {
        one(view, ".picture").addEventListener("click", () => view.classList.toggle("large"));
      }
      this.show();
    }

    get at() {
      return Number(this.range.value);
    }

    /** @param {number} by */
    step(by) {
      this.stop();
      this.range.value = String(this.at + by);
      this.show();
    }

    start() {
      if (this.at === this.frames.length - 1) this.range.value = "0";
      this.play.textContent = WORDS[language].pause;
      this.timer = window.setInterval(() => {
        this.range.value = String(this.at + 1);
        this.show();
        if (this.at === this.frames.length - 1) this.stop();
      }, SLOW_MOTION_MS);
    }

    stop() {
      window.clearInterval(this.timer);
      this.timer = 0;
      this.play.textContent = WORDS[language].play;
    }

    show() {
      const frame = this.frames[this.at];
      this.words.textContent = local(frame.words);
      this.range.setAttribute("aria-valuetext", local(frame.words));
      this.views.forEach((figure, i) => {
        const view = frame.views[i];
        const image = one(figure, "img");
        one(figure, ".picture p").hidden = Boolean(view);
        image.hidden = !view;
        if (view) image.src = view.src;
        one(figure, "svg").innerHTML = view ? view.over : "";
      });
      this.table.classList.toggle("unsure", frame.unsure);
      this.numbers.forEach((cell, i) => (cell.textContent = local(frame.numbers[i])));
      for (const mark of this.marks) {
        mark.toggleAttribute("hidden", frame.cursor === null);
        mark.setAttribute("x1", frame.cursor ?? 0);
        mark.setAttribute("x2", frame.cursor ?? 0);
      }
      this.stick.lines = frame.stick;
      this.stick.draw();
    }
  }

  document.documentElement.classList.add("scripted");
  const jumps = all(document, ".jump").filter((jump) => one(jump, ".scrubber"));
  const scrubbers = jumps.map((jump) => new Scrubber(jump));
  let current = scrubbers[0];

  /** @param {string} chosen */
  function speak(chosen) {
    language = chosen;
    document.documentElement.lang = chosen;
    for (const element of all(document, "[data-nb]")) {
      const words = element.dataset[chosen];
      if (element.localName === "title") element.textContent = words;
      else element.setAttribute(element.localName === "img" ? "alt" : "aria-label", words);
    }
    for (const number of all(document, ".five .value:not(.none), .five .sigma")) {
      number.dataset.written ??= number.textContent;
      number.textContent = local(number.dataset.written);
    }
    for (const button of all(document, "[data-language]")) button.setAttribute("aria-pressed", String(button.dataset.language === chosen));
    for (const scrubber of scrubbers) {
      scrubber.play.textContent = WORDS[chosen][scrubber.timer ? "pause" : "play"];
      scrubber.show();
    }
  }
  for (const button of all(document, "[data-language]")) button.addEventListener("click", () => speak(button.dataset.language));
  speak(/^(nb|nn|no)\b/i.test(navigator.language) ? "nb" : "en");
  jumps.forEach((jump, i) => jump.addEventListener("pointerdown", () => (current = scrubbers[i])));
  document.addEventListener("keydown", (event) => {
    const own = event.target instanceof Element && event.target.closest("input, button");
    if (!current || own || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "ArrowLeft") current.step(-1);
    else if (event.key === "ArrowRight") current.step(1);
    else if (event.key === " ") current.timer ? current.stop() : current.start();
    else return;
    event.preventDefault();
  });
})();
