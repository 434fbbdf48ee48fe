/** The live picture of the triplet. The stream runs only while it is visible; when it breaks, it is opened anew. */

import { say, t } from "../i18n/i18n.js";
import { $, setText } from "../shared/dom.js";
import { known, watch } from "../shared/store.js";
import { makeViewer } from "../shared/viewer.js";

const RETRY_MS = 2_000;
const USUAL_ROWS = 480;
const USUAL_COLUMNS = 640;

/** @type {import("../shared/viewer.js").Viewer} */
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
    notBefore = Date.now() + RETRY_MS; // every news of the status calls draw(), which is more often
    setTimeout(draw, RETRY_MS);
  });
  watch(draw);
}

/**
 * Show one camera large, or all.
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

/** @param {import("../shared/types.js").Status} status */
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
