/** The live triplet. The stream runs only while somebody looks at it, and is opened anew when it breaks. */

import { $, setText } from "./dom.js";
import { say, t } from "./i18n.js";
import { known, watch } from "./store.js";
import { makeViewer } from "./viewer.js";

const RETRY_MS = 2_000;
const USUAL_ROWS = 480;
const USUAL_COLUMNS = 640;

/** @type {import("./viewer.js").Viewer} */
let viewer;
let running = false;
let notBefore = 0;
let ratio = 0;

export function startPreview() {
  viewer = makeViewer($("preview"), showCamera);
  viewer.image.addEventListener("load", () => {
    ratio = viewer.image.naturalWidth / viewer.image.naturalHeight;
    draw();
  });
  viewer.image.addEventListener("error", () => {
    stop();
    notBefore = Date.now() + RETRY_MS; // news of the status draw more often than that
    setTimeout(draw, RETRY_MS);
  });
  watch(draw);
}

/**
 * One camera large, or all.
 *
 * @param {number|null} index
 */
export function showCamera(index) {
  viewer.select(index);
}

/** Index of the camera shown large, null: all. */
export function shownCamera() {
  return viewer.selected();
}

function wanted() {
  const { status, connected, visible, view } = known;
  return Date.now() >= notBefore && connected && visible && view === "live" && ["armed", "recording"].includes(status?.state ?? "");
}

function draw() {
  if (wanted() && !running) {
    running = true;
    viewer.image.src = "./api/preview.mjpg";
  } else if (!wanted() && running) {
    stop();
  }
  if (known.status) drawBlocks(known.status);
}

function stop() {
  running = false;
  viewer.image.removeAttribute("src");
}

/** @param {import("./types.js").Status} status */
function drawBlocks({ cameras, state, pulses }) {
  const blocks = cameras.map((camera, index) => ({
    name: camera.name,
    columns: camera.columns ?? /** @type {[number, number]} */ ([index * USUAL_COLUMNS, (index + 1) * USUAL_COLUMNS]),
  }));
  const columns = blocks.at(-1)?.columns[1] ?? 1;
  viewer.layOut(blocks, ratio ? columns / ratio : USUAL_ROWS);
  cameras.forEach((camera, index) => {
    const fine = camera.state === "ready";
    const { text, advice } = camera.state === "off" ? { text: "", advice: "" } : say(camera.statement);
    viewer.cover(index, camera.statement.level, fine ? "" : t(`camera.${camera.state}`), text, advice);
  });
  viewer.image.alt = t("preview.alt", { cameras: cameras.map((camera) => camera.name).join(", ") });
  const live = state === "armed" || state === "recording";
  $("preview").classList.toggle("dark", !live);
  setText($("preview-hint"), hint(live, pulses.arriving));
}

/**
 * @param {boolean} live
 * @param {boolean} arriving
 */
function hint(live, arriving) {
  if (!live) return t("preview.when_armed");
  if (!arriving) return t("preview.no_pulses");
  return t(viewer.selected() === null ? "preview.tap" : "preview.tap_back");
}
