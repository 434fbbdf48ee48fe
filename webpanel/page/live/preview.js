/** The live picture of the triplet. Pictures come only while it is visible, the next one when the last one is shown. */

import { say, t } from "../i18n/i18n.js";
import { hear, wantPicture } from "../shared/connection.js";
import { $, make, setText } from "../shared/dom.js";
import { known, watch } from "../shared/store.js";
import { onSwipe } from "../shared/swipe.js";
import { makeViewer } from "../shared/viewer.js";

/** The window is too narrow for all cameras side by side: one is shown large, the others by swiping. */
const NARROW = matchMedia("(max-width: 599px)");
const USUAL_ROWS = 480;
const USUAL_COLUMNS = 640;

/** @type {import("../shared/viewer.js").Viewer} */
let viewer;
let running = false;
let cameras = 0;
let ratio = 0;
/** Says that the picture that was set last is shown. */
let shown = () => {};
/** @type {{ code: string, text: string }|null} why the service gives no pictures */
let refused = null;

export function startPreview() {
  viewer = makeViewer($("preview"), showCamera);
  viewer.image.addEventListener("load", () => {
    ratio = viewer.image.naturalWidth / viewer.image.naturalHeight;
    URL.revokeObjectURL(viewer.image.src);
    shown();
    draw();
  });
  hear({ picture: show, noPicture: (why) => { refused = why; draw(); } });
  onSwipe($("preview"), swiped);
  NARROW.addEventListener("change", () => { viewer.select(NARROW.matches ? 0 : null); draw(); });
  watch(draw);
}

/**
 * Show one camera large, or all.
 *
 * @param {number|null} index
 */
export function showCamera(index) {
  viewer.select(index);
  draw();
}

/** Index of the camera shown large, null: all. */
export function shownCamera() {
  return viewer.selected();
}

/** @param {1|-1} step */
function swiped(step) {
  const selected = viewer.selected();
  if (selected === null) return;
  viewer.select((selected + step + cameras) % cameras);
  draw();
}

function wanted() {
  const { status, connected, visible, view } = known;
  return connected && visible && view === "live" && ["armed", "recording"].includes(status?.state ?? "");
}

function draw() {
  if (wanted() && !running) {
    running = true;
    wantPicture("live", true);
  } else if (!wanted() && running) {
    stop();
  }
  if (known.status) drawBlocks(known.status);
}

function stop() {
  running = false;
  wantPicture("live", false);
  viewer.image.removeAttribute("src");
}

/**
 * @param {Blob} image
 * @param {() => void} whenShown
 */
function show(image, whenShown) {
  refused = null;
  shown = whenShown;
  if (running) viewer.image.src = URL.createObjectURL(image);
  else shown();
}

/** @param {import("../shared/types.js").Status} status */
function drawBlocks({ cameras: seen, state, pulses }) {
  const blocks = seen.map((camera, index) => ({
    name: camera.name,
    columns: camera.columns ?? /** @type {[number, number]} */ ([index * USUAL_COLUMNS, (index + 1) * USUAL_COLUMNS]),
  }));
  const columns = blocks.at(-1)?.columns[1] ?? 1;
  viewer.layOut(blocks, ratio ? columns / ratio : USUAL_ROWS);
  if (seen.length !== cameras) {
    cameras = seen.length;
    $("preview-places").replaceChildren(...seen.map(() => make("i")));
    if (NARROW.matches) viewer.select(0);
  }
  $("preview-places").hidden = viewer.selected() === null;
  [...$("preview-places").children].forEach((dot, index) => dot.classList.toggle("here", index === viewer.selected()));
  seen.forEach((camera, index) => {
    const fine = camera.state === "ready";
    const { text, advice } = camera.state === "off" ? { text: "", advice: "" } : say(camera.statement);
    viewer.cover(index, camera.statement.level, fine ? "" : t(`camera.${camera.state}`), text, advice);
  });
  viewer.image.alt = t("preview.alt", { cameras: seen.map((camera) => camera.name).join(", ") });
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
  if (refused) return say(refused).text;
  if (!arriving) return t("preview.no_pulses");
  return t(viewer.selected() === null ? "preview.tap" : NARROW.matches ? "preview.swipe" : "preview.tap_back");
}
