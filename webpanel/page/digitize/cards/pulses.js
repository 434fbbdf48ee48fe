/** The pulses: number, slider, strip of what is measured and what is missing, playing, and jumps to where something is to do. */

import { t } from "../../i18n/i18n.js";
import { $, setIcon, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { attempt, tell } from "../../shared/snacks.js";
import { isOpen, select } from "../marking/marking.js";
import { getNext } from "../session/server.js";
import { reloadSession, reloadView, showPulse } from "../session/session.js";
import { cameras, change, fate, indexOf, listed, state, watch } from "../session/state.js";
import { pageColour } from "../views/colour.js";
import { framesReady } from "../views/frames.js";

/** How many times slower than the jump; 1: as fast. */
const SLOWER = [1, 2, 5, 10, 30, 60];
/** Colours of the gaps. @type {Record<string, string>} */
const GAPS = { l: "--status-lost", m: "--status-missed", d: "--status-damaged", a: "--status-absent" };

/** When playing began, and the index of its first pulse. @type {{ clock: number, index: number }|null} */
let playing = null;

export function startPulses() {
  $("pulse-slider").addEventListener("input", () => go(state.opening?.pulses[Number($("pulse-slider").value)]));
  $("pulse-back").addEventListener("click", () => stepPulse(-1));
  $("pulse-on").addEventListener("click", () => stepPulse(1));
  $("play").addEventListener("click", togglePlay);
  $("speed").addEventListener("change", () => { if (playing) playing = { clock: performance.now(), index: indexOf(state.pulse) }; });
  $("go-gap").addEventListener("click", toGap);
  $("go-open").addEventListener("click", toOpen);
  $("go-worst").addEventListener("click", () => void toWorst());
  $("go-next").addEventListener("click", () => void toNext());
  drawSpeeds();
  watch(draw);
}

/** The speeds, in the language chosen. */
export function drawSpeeds() {
  const chosen = $("speed").value || "10";
  $("speed").replaceChildren(...SLOWER.map((factor) => new Option(factor === 1 ? "1" : `1/${factor}`, String(factor))));
  $("speed").value = chosen;
}

/** @param {number|undefined} pulse */
function go(pulse) {
  if (pulse === undefined) return;
  pause();
  select({ pulse });
}

/** @param {number} steps */
export function stepPulse(steps) {
  const pulses = state.opening?.pulses ?? [];
  go(pulses[Math.min(pulses.length - 1, Math.max(0, indexOf(state.pulse) + steps))]);
}

/** @param {boolean} end */
export function toEnd(end) {
  go(end ? state.opening?.pulses.at(-1) : state.opening?.pulses[0]);
}

export function togglePlay() {
  if (state.playing) return pause();
  const last = (state.opening?.pulses.length ?? 0) - 1;
  playing = { clock: performance.now(), index: indexOf(state.pulse) >= last ? 0 : indexOf(state.pulse) };
  change({ playing: true });
  requestAnimationFrame(playOn);
}

function pause() {
  if (!playing) return;
  playing = null;
  change({ playing: false });
  void reloadView();
}

/** The pulse that belongs to this moment; what is not loaded is waited for, so that each frame shown is that of its number. */
function playOn() {
  const { opening } = state;
  if (!playing || !opening) return;
  const passed = (performance.now() - playing.clock) / 1000 * opening.rate_hz / Number($("speed").value);
  const index = Math.min(opening.pulses.length - 1, playing.index + Math.floor(passed));
  if (!framesReady()) playing = { clock: performance.now(), index: indexOf(state.pulse) };
  else if (index !== indexOf(state.pulse)) showPulse(opening.pulses[index]);
  if (index === opening.pulses.length - 1 && framesReady()) return pause();
  requestAnimationFrame(playOn);
}

/**
 * The first pulse after this one, else from the beginning, of which something is true.
 *
 * @param {(pulse: number) => boolean} holds
 */
function following(holds) {
  const [pulses, at] = [state.opening?.pulses ?? [], indexOf(state.pulse)];
  return [...pulses.slice(at + 1), ...pulses.slice(0, at)].find(holds);
}

/** Go to the next pulse that lacks a frame. */
export function toGap() {
  const pulse = following((one) => cameras().some((camera) => fate(camera, one) !== "o"));
  if (pulse === undefined) tell("info", t("digitize.no_gap"));
  go(pulse);
}

/** Go to the next place where something listed is not measured yet: in this pulse, else in the next ones of the jump. */
export function toOpen() {
  const span = state.opening?.jump;
  const order = cameras().flatMap((camera) => listed().map(({ name }) => ({ camera, thing: name })));
  const here = order.findIndex(({ camera, thing }) => camera === state.camera && thing === state.thing);
  const inPulse = (/** @type {number} */ pulse, from = 0) => order.slice(from).find((one) => isOpen({ ...one, pulse }));
  const later = inPulse(state.pulse, here + 1);
  if (later) return select(later);
  const pulse = following((one) => (!span || one >= span.first && one <= span.last) && inPulse(one) !== undefined);
  const found = pulse === undefined ? inPulse(state.pulse) : inPulse(pulse);
  if (!found) return tell("good", t("digitize.no_open"));
  pause();
  select({ ...found, pulse: pulse ?? state.pulse });
}

/** Go to the ray that fits worst; again: to the next worse. */
export async function toWorst() {
  await reloadSession();
  const worst = state.session?.worst ?? [];
  const at = worst.findIndex(({ pulse, camera, thing }) => pulse === state.pulse && camera === state.camera && thing === state.thing);
  const found = worst[(at + 1) % Math.max(1, worst.length)];
  if (!found) return tell("good", t("digitize.no_worst"));
  pause();
  select(found);
}

/** Go to where one more click lowers the sigmas most. */
export async function toNext() {
  const found = await attempt(async () => ({ next: await getNext(state.operator) }));
  if (!found) return;
  if (!found.next) return tell("good", t("digitize.no_next"));
  pause();
  select(found.next);
  tell("info", found.next.why);
}

function draw() {
  const { opening, pulse } = state;
  if (!opening) return;
  const [pulses, at] = [opening.pulses, indexOf(pulse)];
  const since = opening.jump?.takeoff == null ? "" : ` · ${number((pulse - opening.jump.takeoff) / opening.rate_hz, 3)} s`;
  setText($("pulse-number"), String(pulse));
  setText($("pulse-where"), t("digitize.pulse_of", { index: String(at + 1), count: String(pulses.length) }) + since);
  const slider = $("pulse-slider");
  slider.max = String(pulses.length - 1);
  if (Number(slider.value) !== at) slider.value = String(at);
  slider.setAttribute("aria-valuetext", t("digitize.pulse", { pulse: String(pulse) }));
  setIcon($("play").querySelector("svg"), state.playing ? "pause" : "play");
  $("play").setAttribute("aria-label", t(state.playing ? "scrub.pause" : "scrub.play"));
  drawStrip(at);
}

/** What the strip shows; it is painted anew only when that changes. */
let painted = "";

/** @param {number} at index of the pulse in sight */
function drawStrip(at) {
  const canvas = $("strip");
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((length) => Math.round(length * devicePixelRatio));
  const { opening, session, view } = state;
  const now = [width, height, at, session?.revision, view?.revision, state.group, opening?.jump?.first, document.documentElement.dataset.look].join(" ");
  if (now === painted || !opening || !width) return;
  painted = now;
  Object.assign(canvas, { width, height });
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const colours = Object.fromEntries([...Object.values(GAPS), "--accent", "--text"].map((name) => [name, pageColour(canvas, name)]));
  const [each, row] = [width / opening.pulses.length, height / cameras().length];
  const names = listed().map(({ name }) => name);
  cameras().forEach((camera, line) => {
    opening.pulses.forEach((pulse, index) => {
      const status = GAPS[fate(camera, pulse)];
      const share = names.filter((name) => session?.coverage[name]?.[camera]?.[pulse]).length / (names.length || 1);
      if (!status && !share) return;
      context.globalAlpha = status ? 1 : 0.25 + 0.75 * share;
      context.fillStyle = colours[status ?? "--accent"];
      context.fillRect(index * each, line * row + 1, Math.max(1, each), row - 2);
    });
  });
  context.globalAlpha = 1;
  context.fillStyle = colours["--text"];
  context.fillRect((at + 0.5) * each - devicePixelRatio, 0, 2 * devicePixelRatio, height);
}
