/** Circles over the live picture where the balls of the survey should be, and words for those beyond it. */

import { say, t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { day, number, timeOfDay } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";
import { known, load, save } from "../shared/store.js";

/** @typedef {import("./types.js").CameraBalls} CameraBalls */
/** @typedef {import("./types.js").BallPlace} BallPlace */
/** @typedef {{ left: number, top: number, right: number, bottom: number }} Box */

/** An orientation that was made meanwhile is seen after so long a time. */
const AGAIN_MS = 5000;
/** Radii of circles on the screen, px; so many sigmas of a place make one larger. */
const LEAST_PX = 10;
const MOST_PX = 60;
const SIGMAS = 3;
/** From circles to their names, and of arrows to the edge, px. */
const GAP_PX = 2;
const INSET_PX = 12;
/** Where a name may stand beside its circle, right and down, the best place first. */
const SIDES = [[1, 0], [-1, 0], [0, -1], [0, 1], [1, -1], [-1, -1], [1, 1], [-1, 1], [0.5, 1], [-0.5, 1], [0.5, -1], [-0.5, -1]];

/** Name of the camera that is shown. */
let camera = "";
/** @type {CameraBalls|null} */
let balls = null;
let askedAt = 0;
/** What is drawn now, so that it is not drawn again. */
let drawn = "";

export function startBalls() {
  $("balls-on").checked = load("balls", true);
  $("balls-on").addEventListener("change", () => {
    save("balls", $("balls-on").checked);
    ballsOf(camera);
  });
  new ResizeObserver(draw).observe($("balls"));
}

/**
 * Show the balls of a camera; ask for them when another one is shown, and now and then.
 *
 * @param {string} name
 */
export function ballsOf(name) {
  if (name !== camera) [camera, balls, askedAt] = [name, null, 0];
  const wanted = name && $("balls-on").checked && known.view === "aim" && known.connected && known.visible;
  if (wanted && (!askedAt || performance.now() - askedAt > AGAIN_MS)) {
    askedAt = performance.now();
    void attempt(async () => {
      const found = await call("GET", `cameras/${encodeURIComponent(name)}/balls`);
      if (name !== camera) return;
      balls = found;
      draw();
    });
  }
  draw();
}

function draw() {
  const shown = $("balls-on").checked ? balls : null;
  const layer = $("balls");
  layer.hidden = !shown?.balls.length;
  $("balls-words").hidden = !shown;
  if (shown) drawWords(shown);
  if (!shown || layer.hidden) return;
  layer.style.aspectRatio = `${shown.width} / ${shown.height}`;
  const state = JSON.stringify([shown, layer.clientWidth]);
  if (state === drawn || !layer.clientWidth) return;
  drawn = state;
  layer.classList.toggle("rough", shown.source === "survey" || shown.source === "plan");
  place(layer, shown);
}

/**
 * Put circles, arrows and names where they belong. A name stands beside its circle where there is room, or not at all.
 *
 * @param {HTMLElement} layer
 * @param {CameraBalls} shown
 */
function place(layer, shown) {
  const scale = layer.clientWidth / shown.width;
  const [width, height] = [layer.clientWidth, shown.height * scale];
  layer.replaceChildren();
  /** @type {{ ball: BallPlace, x: number, y: number, radius: number }[]} */
  const marks = [];
  for (const ball of shown.balls) {
    if (ball.x === null || ball.y === null) continue;
    const x = (ball.x + 0.5) * scale;
    const y = (ball.y + 0.5) * scale;
    if (ball.inside) {
      const radius = Math.min(MOST_PX, Math.max(LEAST_PX, SIGMAS * scale * Math.max(...(ball.sigma ?? [0]))));
      marks.push({ ball, x, y, radius });
    } else {
      const inset = { x: clamp(x, INSET_PX, width - INSET_PX), y: clamp(y, INSET_PX, height - INSET_PX) };
      marks.push({ ball, ...inset, radius: LEAST_PX });
    }
  }
  const taken = marks.map(({ x, y, radius }) => around(x, y, radius, radius));
  for (const { ball, x, y, radius } of marks) {
    layer.append(ball.inside ? circle(ball, x, y, radius) : arrow(x, y, (Number(ball.x) + 0.5) * scale, (Number(ball.y) + 0.5) * scale));
    const name = make("b", { class: ball.inside ? "" : "beyond" }, ball.name);
    layer.append(name);
    const half = { x: name.offsetWidth / 2, y: name.offsetHeight / 2 };
    const away = { x: radius + GAP_PX + half.x, y: radius + GAP_PX + half.y };
    const boxes = SIDES.map(([right, down]) => around(x + right * away.x, y + down * away.y, half.x, half.y));
    const free = boxes.find((box) => box.left >= 0 && box.top >= 0 && box.right <= width && box.bottom <= height && !taken.some((other) => overlap(box, other)));
    if (!free) {
      name.remove();
      continue;
    }
    taken.push(free);
    name.style.left = `${free.left}px`;
    name.style.top = `${free.top}px`;
  }
}

/**
 * @param {BallPlace} ball
 * @param {number} x
 * @param {number} y
 * @param {number} radius
 */
function circle(ball, x, y, radius) {
  const ring = make("i", { class: ball.seen === false ? "unfound" : "", "data-ball": ball.name });
  Object.assign(ring.style, { left: `${x}px`, top: `${y}px`, width: `${2 * radius}px`, height: `${2 * radius}px` });
  return ring;
}

/**
 * An arrow at an edge, towards a ball beyond it.
 *
 * @param {number} x
 * @param {number} y
 * @param {number} towardsX
 * @param {number} towardsY
 */
function arrow(x, y, towardsX, towardsY) {
  const point = make("s");
  Object.assign(point.style, { left: `${x}px`, top: `${y}px`, rotate: `${Math.atan2(towardsY - y, towardsX - x)}rad` });
  return point;
}

/**
 * Say below the picture how many balls are in it, which are not and by how much, and how that is known; or what to do.
 *
 * @param {CameraBalls} shown
 */
function drawWords(shown) {
  const missing = shown.balls.filter(isMissing).map((ball) => `${ball.name}: ${beyond(ball, shown)}`);
  const { text, advice } = shown.statement ? say(shown.statement) : { text: counted(shown, missing), advice: source(shown) };
  setText($("balls-said"), sentence(text));
  setText($("balls-by"), sentence(advice));
  $("balls-said").dataset.level = missing.length || shown.statement?.level === "warning" ? "warning" : "";
}

/**
 * @param {CameraBalls} shown
 * @param {string[]} missing
 */
function counted({ balls: all }, missing) {
  const inside = t("balls.inside", { inside: all.filter((ball) => ball.inside).length, all: all.length });
  return missing.length ? `${inside} ${missing.join("; ")}` : inside;
}

/** What the places follow from. @param {CameraBalls} shown */
function source({ source: kind, file, oriented }) {
  if (kind === "orientation") return t("balls.by_orientation", { when: oriented ? `${day(oriented)} ${timeOfDay(oriented)}` : "" });
  if (kind === "calibration") return t("balls.by_calibration", { file: file ?? "" });
  return kind === "survey" ? t("balls.by_survey", { file: file ?? "" }) : t("balls.by_plan", { file: file ?? "" });
}

/** @param {string} text */
function sentence(text) {
  return text && `${text[0].toUpperCase()}${text.slice(1)}${text.endsWith(".") ? "" : "."}`;
}

/** Whether the camera should show a ball and does not. @param {BallPlace} ball */
function isMissing(ball) {
  return !ball.inside && ball.seen !== false;
}

/**
 * @param {BallPlace} ball
 * @param {CameraBalls} picture
 */
function beyond({ x, y }, { width, height }) {
  if (x === null || y === null) return t("balls.behind");
  const sides = [];
  if (x < -0.5) sides.push(t("balls.left", { px: away(-0.5 - x) }));
  if (x > width - 0.5) sides.push(t("balls.right", { px: away(x - width + 0.5) }));
  if (y < -0.5) sides.push(t("balls.top", { px: away(-0.5 - y) }));
  if (y > height - 0.5) sides.push(t("balls.bottom", { px: away(y - height + 0.5) }));
  return sides.join(", ");
}

/** @param {number} px */
function away(px) {
  return number(Math.max(1, Math.round(px)));
}

/**
 * @param {number} x
 * @param {number} y
 * @param {number} halfWidth
 * @param {number} halfHeight
 * @returns {Box}
 */
function around(x, y, halfWidth, halfHeight) {
  return { left: x - halfWidth, top: y - halfHeight, right: x + halfWidth, bottom: y + halfHeight };
}

/**
 * @param {Box} one
 * @param {Box} other
 */
function overlap(one, other) {
  return one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
}

/**
 * @param {number} value
 * @param {number} least
 * @param {number} most
 */
function clamp(value, least, most) {
  return Math.min(most, Math.max(least, value));
}
