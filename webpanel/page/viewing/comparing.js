/** A second jump beside the one shown, or over it as a ghost: both aligned at their take-offs, or both where most moves. */

import { languageInUse, t } from "../i18n/i18n.js";
import { call, callForPage, partOf, recordingPath } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { day, number, who } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";
import { makeViewer } from "../shared/viewer.js";
import { jumpShown, onJump } from "./jumps.js";
import { onShown, pulseShown, sinceMoment } from "./scrubber.js";

/** @typedef {import("../shared/types.js").Recording} Recording */
/** @typedef {import("../shared/types.js").Pulses} Pulses */
/** @typedef {{ pulse: number|null, kind: "takeoff"|"activity"|"none", from_log: boolean, exact: number|null }} Moment */
/** @typedef {{ pulses: Pulses, jump: number, zero_s: number }} Aligned a jump, and the time in it that the other's answers to */
/** @typedef {{ recording: Recording, jump: number, several: boolean }} Choice a jump; `several`: its recording has more of them */

/** The jumps of so many recordings can be chosen among, the newest. */
const CHOICES = 100;
/** So many measured jumps are looked through for recordings with several. */
const MEASURED = 400;

/** @type {import("../shared/viewer.js").Viewer} */
let viewer;
/** The jump shown and the other one; null: no other is shown. @type {{ own: Aligned, other: Aligned, kind: Moment["kind"], measured: boolean }|null} */
let pair = null;
/** The picture of the other jump over that of the one shown. @type {HTMLImageElement} */
let ghost;
let ghostly = false;
/** The one shown. @type {Recording|null} */
let shown = null;
/** @type {Choice[]} */
let choices = [];
let loading = false;

export function startComparing() {
  viewer = makeViewer($("other-frames"), () => {});
  ghost = make("img", { class: "ghost", alt: "", draggable: false, hidden: true });
  $("frames").querySelector(".plane").append(ghost);
  $("compare").addEventListener("change", () => void attempt(() => choose($("compare").value)));
  for (const [button, way] of /** @type {[string, boolean][]} */ ([["compare-beside", false], ["compare-ghost", true]])) {
    $(button).addEventListener("click", () => { ghostly = way; draw(); });
  }
  viewer.image.addEventListener("load", () => { loading = false; draw(); });
  viewer.image.addEventListener("error", () => { loading = false; });
  onShown(draw);
  onJump(() => { if (shown) void attempt(() => choose($("compare").value)); });
}

/**
 * Offer other jumps to compare with; those of the same athlete first.
 *
 * @param {Recording} recording the one shown
 */
export async function offer(recording) {
  if (shown?.id !== recording.id) leave();
  shown = recording;
  const [{ items }, measured] = await Promise.all([callForPage(`recordings?limit=${CHOICES}`), call("GET", `jumps?limit=${MEASURED}`)]);
  if (shown.id !== recording.id) return;
  /** @type {Map<string, number[]>} */
  const numbers = new Map();
  for (const { jump } of measured) numbers.set(jump.recording, [...numbers.get(jump.recording) ?? [], jump.jump]);
  const jumpsOf = (/** @type {string} */ id) => (numbers.get(id) ?? [1]).sort((one, two) => one - two);
  const same = (/** @type {Choice} */ each) => Number(each.recording.session.athlete === recording.session.athlete);
  const ended = [...items, ...items.some((/** @type {Recording} */ each) => each.id === recording.id) ? [] : [recording]];
  choices = ended.filter((/** @type {Recording} */ each) => each.counts.pulses && each.state !== "recording")
    .flatMap((/** @type {Recording} */ each) => jumpsOf(each.id).map((jump, _, all) => ({ recording: each, jump, several: all.length > 1 })));
  choices.sort((one, two) => same(two) - same(one));
  drawChoices();
}

/** Draw the choice, perhaps in another language. */
export function drawChoices() {
  const chosen = pair ? valueOf(pair.other.pulses.id, pair.other.jump) : "";
  const others = choices.filter(({ recording, jump }) => recording.id !== shown?.id || jump !== jumpShown());
  $("compare").replaceChildren(
    make("option", { value: "" }, t("compare.none")),
    ...others.map((each) => make("option", { value: valueOf(each.recording.id, each.jump) }, named(each))),
  );
  $("compare").value = others.some(({ recording, jump }) => valueOf(recording.id, jump) === chosen) ? chosen : "";
  $("compare-choice").hidden = others.length === 0;
  if (!pair) return;
  setText($("compare-how"), inWords(pair));
  $("compare-page").hidden = !pair.measured;
  $("compare-page").href = `./api/comparison.html?${new URLSearchParams({ first: pair.own.pulses.id, first_jump: String(pair.own.jump), second: pair.other.pulses.id, second_jump: String(pair.other.jump), language: languageInUse() })}`;
}

/**
 * @param {string} id of a recording
 * @param {number} jump
 */
function valueOf(id, jump) {
  return `${id}/${jump}`;
}

/** @param {Choice} choice */
function named({ recording: { id, session, started }, jump, several }) {
  return [who(session, id), ...started ? [day(started)] : [], ...several ? [t("jump.number", { jump })] : []].join(", ");
}

function leave() {
  pair = null;
  choices = [];
  loading = false;
  for (const image of [viewer.image, ghost]) image.removeAttribute("src");
  for (const part of ["other", "comparing"]) $(part).hidden = true;
  ghost.hidden = true;
  $("both").classList.remove("two");
  drawChoices();
}

/** @param {string} value of the other jump; empty: none */
async function choose(value) {
  const kept = choices;
  leave();
  choices = kept;
  drawChoices();
  const [beside, jump] = [shown?.id, jumpShown()];
  if (!value || !beside || value === valueOf(beside, jump)) return;
  $("compare").value = value;
  const [id, other] = value.split("/");
  const found = await align([beside, id], [jump, Number(other)]);
  if (shown?.id !== beside || jumpShown() !== jump || $("compare").value !== value) return;
  pair = found;
  const { pulses } = pair.other;
  viewer.layOut(pulses.cameras.map((name, index) => ({ name, columns: pulses.columns[index] })), pulses.shape[0]);
  $("comparing").hidden = false;
  drawChoices();
  draw();
}

/**
 * Two jumps aligned at the take-offs that were measured of both, otherwise where most moves in each: one kind for both.
 *
 * @param {string[]} both recordings
 * @param {number[]} jumps their numbers
 */
async function align(both, jumps) {
  /** @type {Pulses[]} */
  const pulses = await Promise.all(both.map((id) => call("GET", recordingPath(id, "/pulses"))));
  /** @type {Moment[]} */
  let moments = await Promise.all(both.map((id, place) => call("GET", recordingPath(id, `/moment?jump=${jumps[place]}`))));
  if (moments.some(({ kind }) => kind !== "takeoff")) moments = await Promise.all(both.map((id, place) => call("GET", recordingPath(id, `/moment?by_motion=true&jump=${jumps[place]}`))));
  const kind = moments.some((moment) => moment.kind === "none") ? "none" : moments[0].kind;
  const [one, two] = both.map((_, place) => ({ pulses: pulses[place], jump: jumps[place], zero_s: kind === "none" ? 0 : timeAt(pulses[place], moments[place]) }));
  return { own: one, other: two, kind, measured: moments.every(({ from_log }) => from_log) };
}

/**
 * Time of a moment in a recording, s: between two pulses if it was measured.
 *
 * @param {Pulses} recording
 * @param {Moment} moment
 */
function timeAt({ pulses }, { pulse, exact }) {
  const wanted = exact ?? pulse ?? 0;
  const after = Math.max(1, pulses.findIndex((each) => each.pulse > wanted));
  const [one, two] = [pulses[after - 1], pulses[after] ?? pulses[after - 1]];
  return one.time_s + (two.pulse > one.pulse ? ((wanted - one.pulse) / (two.pulse - one.pulse)) * (two.time_s - one.time_s) : 0);
}

/** Whether the other jump was seen by the same cameras in the same columns, so that one picture may lie over the other. */
function overlays() {
  const [one, two] = [pair?.own.pulses, pair?.other.pulses].map((each) => JSON.stringify([each?.cameras, each?.columns, each?.shape]));
  return one === two;
}

/** @param {{ kind: Moment["kind"] }} aligned */
function inWords({ kind }) {
  const how = { takeoff: t("compare.by_takeoff"), activity: t("compare.by_motion"), none: t("compare.by_beginning") };
  return [how[kind], overlays() ? "" : t("compare.no_ghost")].filter(Boolean).join(" ");
}

/** Show the pulse of the other jump that is as long after its moment as the one in sight is after its own. */
function draw() {
  const here = pair?.own.pulses.pulses.find(({ pulse }) => pulse === pulseShown());
  if (!pair || !here) return;
  const { camera } = sinceMoment();
  const { zero_s, pulses: { id, pulses, cameras } } = pair.other;
  const time_s = zero_s + here.time_s - pair.own.zero_s;
  const later = pulses.findIndex((each) => each.time_s >= time_s);
  let index = later < 0 ? pulses.length - 1 : later;
  if (index > 0 && time_s - pulses[index - 1].time_s < pulses[index].time_s - time_s) index -= 1;
  const { pulse, statuses } = pulses[index];
  viewer.select(camera !== null && camera < cameras.length ? camera : null);
  statuses.forEach((status, place) => viewer.cover(place, "warning", status === "ok" ? "" : t(`status.${status}`), "", ""));
  viewer.image.alt = t("scrub.alt", { pulse });
  setText($("other-where"), t("compare.where", { pulse, since: number(pulses[index].time_s - zero_s, 3) }));
  drawWay();
  const address = new URL(partOf(id, `pulses/${pulse}.jpg`), document.baseURI).href;
  if (loading || viewer.image.src === address) return;
  loading = true;
  viewer.image.src = address;
}

/** Show the other jump beside the one shown, or over it. */
function drawWay() {
  const over = ghostly && overlays();
  $("compare-ghost").disabled = !overlays();
  $("compare-beside").setAttribute("aria-pressed", String(!over));
  $("compare-ghost").setAttribute("aria-pressed", String(over));
  $("other").hidden = over;
  $("both").classList.toggle("two", !over);
  ghost.hidden = !over;
  if (!over) return;
  const below = /** @type {HTMLImageElement} */ ($("frames").querySelector(".plane img"));
  [ghost.style.width, ghost.style.left] = [below.style.width, below.style.left];
  if (viewer.image.src && ghost.src !== viewer.image.src) ghost.src = viewer.image.src;
}
