/**
 * A jump again and again in slow motion, about its take-off or, if that was not measured, about where most moves.
 *
 * Its pictures are fetched once, few of them, one after the other, and only while no recording runs: the disk belongs to
 * the recorder then. They are kept as they came and decoded one at a time, so that a small device can show them too.
 *
 * @typedef {object} Replay
 * @property {(id: string, version?: string, jump?: number) => void} show a jump of a recording; "": none. Another version: its moment may be another one.
 * @property {() => void} draw the words anew, in another language
 */

import { t } from "../i18n/i18n.js";
import { asProblem, call, partOf, Problem, recordingPath } from "./api.js";
import { icon, make, setIcon, setText } from "./dom.js";
import { watch } from "./store.js";

/** A loop begins so long before the moment and ends so long after it, s. */
const [BEFORE_S, AFTER_S] = [0.5, 1];
/** So many times slower than the jump. */
const SLOWER = 4;
/** The last picture stands for so long before the first one comes again, ms. */
const REST_MS = 800;
/** More pictures than these say no more at this speed. */
const PICTURES_MAX = 45;
/** Width of the pictures, px. */
const WIDTH = 1440;
/** So soon it is tried again after a failure, ms. */
const AGAIN_MS = 3000;
/** While nobody sees it, it looks so often whether somebody does, ms. */
const IDLE_MS = 500;

/** @typedef {{ pulse: number, time_s: number, image: Blob|null }} Frame */
/**
 * @typedef {{ frames: Frame[], kind: string, moment: number, cameras: string[], columns: [number, number][] }} Scene
 *   `moment`: index of the frame that matters; `columns`: of each camera in the triplet
 */
/** @typedef {""|"loading"|"waits"|"none"|"ready"} Stage */

/** @type {Scene} */
const NOTHING = { frames: [], kind: "none", moment: 0, cameras: [], columns: [] };
/** In less than this all cameras side by side would be too small to see a jumper in, px. */
const WIDE_ENOUGH_PX = 480;

/**
 * @param {HTMLElement} root
 * @param {{ may: () => boolean, button: boolean }} options `may`: whether pictures may be fetched now; `button`: it has buttons, to stop it and to see one camera large
 * @returns {Replay}
 */
export function makeReplay(root, { may, button }) {
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches && button;
  const canvas = make("canvas", { role: "img" });
  const words = make("p", { class: "replay-words" });
  const play = make("button", { type: "button", class: "square replay-play", onclick: () => { playing = !playing; draw(); } }, icon("pause"));
  const other = make("button", { type: "button", class: "replay-camera", onclick: () => { camera += 1; draw(); void paint(painted); } });
  root.append(canvas, make("div", { class: "replay-foot" }, words, ...button ? [other, play] : []));
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));

  /** Recording, version and number of the jump that are shown. */
  let [id, known, number] = ["", "", 1];
  /** Numbers of the loading and of the showing that began last: those before them are given up. */
  let [loads, runs] = [0, 0];
  /** What is shown. @type {Scene} */
  let scene = NOTHING;
  /** @type {Stage} */
  let stage = "";
  let playing = !still;
  /** Which camera is shown, counted on and on; 0: all; -1: not chosen yet. Where nobody can choose, each has its turn. */
  let camera = -1;
  /** What is in sight. @type {Frame|null} */
  let painted = null;
  let wake = () => {};

  /**
   * Load the pictures; those that are shown stay until the others are there.
   *
   * @param {number} own
   */
  async function load(own) {
    let coming = NOTHING;
    while (own === loads) {
      try {
        if (!may()) await waitFor(own);
        if (own !== loads) return;
        become("loading");
        if (!coming.frames.length) coming = await choose(id, number);
        for (const frame of coming.frames.filter(({ image }) => !image)) {
          if (own !== loads || !may()) break;
          frame.image = await fetchPicture(id, frame.pulse);
        }
        if (own !== loads) return;
        if (coming.frames.some(({ image }) => !image)) continue;
        scene = coming;
        if (camera < 0) camera = root.clientWidth < WIDE_ENOUGH_PX ? 1 : 0;
        become(scene.frames.length ? "ready" : "none");
        if (scene.frames.length) void run(++runs);
        return;
      } catch (error) {
        if (!(error instanceof Problem)) throw error;
        if (own !== loads) return;
        if (error.status !== 0 && error.status !== 503) return become("none");
        become(error.code === "recording_runs" ? "waits" : "loading");
        await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
      }
    }
  }

  /** @param {number} own */
  async function waitFor(own) {
    become("waits");
    while (!may() && own === loads) await new Promise((resolve) => { wake = () => resolve(undefined); });
  }

  /**
   * Show the pictures, until others are shown.
   *
   * @param {number} own
   */
  async function run(own) {
    const { frames, moment } = scene;
    await paint(frames[moment]);
    for (let index = 0; own === runs;) {
      const seen = playing && !document.hidden && root.checkVisibility();
      if (seen) await paint(frames[index]);
      const [now, next] = [frames[index], frames[index + 1]];
      await new Promise((resolve) => setTimeout(resolve, !seen ? IDLE_MS : next ? 1000 * SLOWER * (next.time_s - now.time_s) : REST_MS));
      if (seen) index = next ? index + 1 : 0;
      if (seen && !next && !button && camera) camera = camera % scene.cameras.length + 1;
    }
  }

  /** Index of the one camera that is shown; -1: all. */
  function one() {
    return Math.max(0, camera) % (scene.cameras.length + 1) - 1;
  }

  /** @param {Frame|null} frame */
  async function paint(frame) {
    if (!frame?.image) return;
    painted = frame;
    const { columns } = scene;
    const picture = await createImageBitmap(frame.image);
    const all = columns[columns.length - 1][1];
    const [left, right] = one() < 0 ? [0, all] : columns[one()];
    const [from, wide] = [Math.round(left * picture.width / all), Math.round((right - left) * picture.width / all)];
    if (canvas.width !== wide || canvas.height !== picture.height) [canvas.width, canvas.height] = [wide, picture.height];
    pen.drawImage(picture, -from, 0);
    picture.close();
    root.dataset.pulse = String(frame.pulse);
  }

  /** @param {Stage} now */
  function become(now) {
    stage = scene.frames.length ? "ready" : now;
    draw();
  }

  function draw() {
    root.dataset.stage = stage;
    canvas.hidden = stage !== "ready";
    play.hidden = other.hidden = stage !== "ready";
    setText(other, one() < 0 ? t("replay.all") : scene.cameras[one()]);
    other.setAttribute("aria-label", one() < 0 ? t("replay.all") : t("replay.camera", { camera: scene.cameras[one()] }));
    canvas.setAttribute("aria-label", t("replay.alt"));
    setIcon(play.querySelector("svg"), playing ? "pause" : "play");
    play.setAttribute("aria-label", t(playing ? "replay.pause" : "replay.play"));
    setText(words, inWords());
  }

  function inWords() {
    if (stage === "waits") return t("replay.waits");
    if (stage === "loading") return t("replay.loading");
    if (stage === "none") return t("replay.none");
    if (stage === "") return "";
    return t({ takeoff: "replay.takeoff", activity: "replay.activity" }[scene.kind] ?? "replay.middle", { times: SLOWER });
  }

  watch(() => { if (may()) wake(); });
  draw();

  return {
    draw,
    show(recording, version = "", jump = 1) {
      if (recording === id && (version === known && jump === number || !id)) return;
      if (recording !== id) {
        scene = NOTHING; // nothing of another jump is shown, not even for a moment
        runs += 1;
      }
      [id, known, number] = [recording, version, jump];
      loads += 1;
      wake();
      become("");
      if (id) void load(loads);
    },
  };
}

/**
 * Choose the pictures of a jump.
 *
 * @param {string} id of its recording
 * @param {number} jump its number
 * @returns {Promise<Scene>}
 * @throws {Problem}
 */
async function choose(id, jump) {
  /** @type {import("./types.js").Pulses} */
  const { pulses, cameras, columns } = await call("GET", recordingPath(id, "/pulses"));
  const found = await call("GET", recordingPath(id, `/moment?jump=${jump}`));
  if (!pulses.length) return NOTHING;
  const at = Math.max(0, found.pulse === null ? Math.floor(pulses.length / 2) : pulses.findIndex(({ pulse }) => pulse === found.pulse));
  const middle = pulses[at];
  const near = pulses.filter(({ time_s }) => time_s >= middle.time_s - BEFORE_S && time_s <= middle.time_s + AFTER_S);
  const every = Math.ceil(near.length / PICTURES_MAX);
  const first = near.indexOf(middle) % every; // the moment itself is one of them
  const frames = near.filter((_, index) => index % every === first).map(({ pulse, time_s }) => ({ pulse, time_s, image: null }));
  return { frames, kind: found.kind, moment: frames.findIndex(({ pulse }) => pulse === middle.pulse), cameras, columns };
}

/**
 * @param {string} id
 * @param {number} pulse
 * @returns {Promise<Blob>}
 * @throws {Problem}
 */
async function fetchPicture(id, pulse) {
  let answer;
  try {
    answer = await fetch(partOf(id, `pulses/${pulse}.jpg?width=${WIDTH}`));
    if (answer.ok) return await answer.blob();
  } catch {
    throw new Problem(0, "page_no_connection", "no connection to the service: check network and service, then try again");
  }
  throw await asProblem(answer);
}
