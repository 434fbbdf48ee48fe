/** Sets up one camera: its picture with what is in focus, a bar that holds the best sharpness, and its exposure. */

import { t } from "../i18n/i18n.js";
import { API, asProblem, call, Problem } from "../shared/api.js";
import { $, fillList, make, setText } from "../shared/dom.js";
import { number, quantity } from "../shared/format.js";
import { tellProblem } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";
import { ballsOf, startBalls } from "./balls.js";
import { calibratingOf, startCalibrating } from "./calibrating.js";
import { earlierOf } from "./earlier.js";
import { lightOf, startLight } from "./light.js";

/** After a failed call. */
const PAUSE_MS = 2000;
/** From here on the bar counts as full: noise and the hand on the lens change the measure by that much. */
const NEAR_BEST = 0.97;
/** So many percent of clipped pixels are more than lamps and reflections: what is white there cannot be measured. */
const MUCH_CLIPPED = 1;
const HEIGHT = 24;

/** @typedef {import("./types.js").CameraAids} CameraAids */

/** Name of the camera that is shown. */
let camera = "";
/** The best sharpness of each camera since it was forgotten. @type {Map<string, number>} */
const best = new Map();
/** @type {CameraAids|null} */
let aids = null;
let running = false;
/** Address of the picture that is shown; the browser keeps a picture for as long as it has one. */
let picture = "";

export function startAim() {
  startLight();
  startBalls();
  startCalibrating();
  $("aim-again").addEventListener("click", () => { best.delete(camera); draw(); });
  watch(() => {
    draw();
    if (wanted() && !running) void run();
  });
}

function wanted() {
  return known.connected && known.visible && known.view === "aim" && ["armed", "recording"].includes(known.status?.state ?? "");
}

/** Fetch figures and pictures, the next when the last are shown. */
async function run() {
  running = true;
  while (wanted()) {
    try {
      await look(camera);
    } catch (error) {
      tellProblem(error);
      await new Promise((resolve) => { setTimeout(resolve, PAUSE_MS); });
    }
  }
  running = false;
}

/** @param {string} name */
async function look(name) {
  const path = `cameras/${encodeURIComponent(name)}`;
  const found = await call("GET", `${path}/aids?after=${aids?.camera === name ? aids.pulse : -1}`);
  if (name !== camera || !wanted()) return;
  aids = found ?? aids;
  if (found?.focus) best.set(name, Math.max(best.get(name) ?? 0, found.focus));
  draw();
  if (found) await show(`${path}/picture.jpg?peaking=${$("aim-peaking").checked}`, name);
}

/**
 * @param {string} path
 * @param {string} name
 */
async function show(path, name) {
  let answer;
  try {
    answer = await fetch(API + path, { cache: "no-store" });
  } catch {
    throw new Problem(0, "page_no_connection", "no connection to the service: check network and service, then try again");
  }
  if (!answer.ok) throw await asProblem(answer);
  if (answer.status === 204) return;
  const next = URL.createObjectURL(await answer.blob());
  // Decoded apart: a browser that is given another source while it decodes may never answer.
  const ahead = make("img", { src: next });
  await ahead.decode().catch(() => {}); // no picture is better than none ever again
  if (name !== camera) {
    URL.revokeObjectURL(next);
    return;
  }
  $("aim-image").src = next;
  URL.revokeObjectURL(picture);
  picture = next;
}

function draw() {
  const { status } = known;
  const names = (status?.cameras ?? []).map(({ name }) => name);
  if (!names.includes(camera)) camera = names[0] ?? "";
  const buttons = $("aim-cameras");
  if ([...buttons.children].map((button) => button.textContent).join() !== names.join()) {
    buttons.replaceChildren(...names.map((name) => make("button", { type: "button", onclick: () => choose(name) }, name)));
  }
  earlierOf(camera);
  if (known.view === "aim" && known.connected) lightOf(camera);
  for (const button of buttons.children) button.setAttribute("aria-pressed", String(button.textContent === camera));
  const on = ["armed", "recording"].includes(status?.state ?? "");
  const shown = on && aids?.camera === camera ? aids : null;
  setText($("aim-empty"), t(on ? "aim.no_pulses" : "aim.when_armed"));
  $("aim-empty").hidden = on && (shown !== null || (status?.pulses.arriving ?? false));
  $("aiming").hidden = !shown;
  ballsOf(camera);
  calibratingOf(camera);
  if (shown) drawFigures(shown);
}

/** @param {string} name */
function choose(name) {
  camera = name;
  $("aim-image").removeAttribute("src");
  draw();
}

/** @param {CameraAids} shown */
function drawFigures({ focus, mean, clipped, black, histogram }) {
  const peak = best.get(camera) ?? focus ?? 0;
  const share = focus === null || !peak ? 0 : focus / peak;
  setText($("aim-missing"), t("aim.missing"));
  $("aim-missing").hidden = focus !== null;
  $("aim-image").alt = t("aim.picture", { camera });
  setText($("aim-value"), focus === null ? "–" : number(focus, 2));
  setText($("aim-share"), focus === null ? "" : t("aim.share", { percent: Math.round(100 * share) }));
  $("aim-focus").dataset.level = share >= NEAR_BEST ? "good" : "warning";
  $("aim-bar").setAttribute("aria-valuenow", String(Math.round(100 * share)));
  $("aim-bar").firstElementChild.style.width = `${100 * share}%`;
  $("aim-histogram").setAttribute("d", outline(histogram));
  fillList($("aim-figures"), [
    [t("aim.clipped"), quantity(clipped, 2, "%"), (clipped ?? 0) > MUCH_CLIPPED ? "warning" : ""],
    [t("aim.black"), quantity(black, 2, "%"), (black ?? 0) > MUCH_CLIPPED ? "warning" : ""],
    [t("aim.mean"), quantity(mean, 0, "%")],
  ]);
}

/**
 * The outline of a histogram. Heights are square roots of counts, so that few pixels are seen beside many.
 *
 * @param {number[]} counts
 */
function outline(counts) {
  const largest = Math.sqrt(Math.max(1, ...counts));
  const steps = counts.map((count, index) => `V${(HEIGHT * (1 - Math.sqrt(count) / largest)).toFixed(2)}H${index + 1}`);
  return `M0 ${HEIGHT}${steps.join("")}V${HEIGHT}Z`;
}
