/** A second jump beside the one shown, or over it as a ghost: both aligned at their take-offs, or both where most moves. */

import { languageInUse, t } from "../i18n/i18n.js";
import { call, callForPage, partOf, recordingPath } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { day, number, who } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";
import { makeViewer } from "../shared/viewer.js";
import { onShown, pulseShown, sinceMoment } from "./scrubber.js";

/** @typedef {import("../shared/types.js").Recording} Recording */
/** @typedef {import("../shared/types.js").Pulses} Pulses */
/** @typedef {{ pulse: number|null, kind: "takeoff"|"activity"|"none", from_log: boolean, exact: number|null }} Moment */
/** @typedef {{ pulses: Pulses, zero_s: number }} Aligned a jump, and the time in it that the other's answers to */

/** So many jumps can be chosen among, the newest. */
const CHOICES = 100;

/** @type {import("../shared/viewer.js").Viewer} */
let viewer;
/** The jump shown and the other one; null: no other is shown. @type {{ own: Aligned, other: Aligned, kind: Moment["kind"], measured: boolean }|null} */
let pair = null;
/** The picture of the other jump over that of the one shown. @type {HTMLImageElement} */
let ghost;
let ghostly = false;
/** The one shown. @type {Recording|null} */
let shown = null;
/** @type {Recording[]} */
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
}

/**
 * Offer other jumps to compare with; those of the same athlete first.
 *
 * @param {Recording} recording the one shown
 */
export async function offer(recording) {
  if (shown?.id !== recording.id) leave();
  shown = recording;
  const { items } = await callForPage(`recordings?limit=${CHOICES}`);
  if (shown.id !== recording.id) return;
  const same = (/** @type {Recording} */ { session }) => Number(session.athlete === recording.session.athlete);
  choices = items.filter((/** @type {Recording} */ each) => each.id !== recording.id && each.counts.pulses && each.state !== "recording");
  choices.sort((one, two) => same(two) - same(one));
  drawChoices();
}

/** Draw the choice, perhaps in another language. */
export function drawChoices() {
  const chosen = pair?.other.pulses.id ?? "";
  $("compare").replaceChildren(
    make("option", { value: "" }, t("compare.none")),
    ...choices.map(({ id, session, started }) => make("option", { value: id }, `${who(session, id)}${started ? `, ${day(started)}` : ""}`)),
  );
  $("compare").value = choices.some(({ id }) => id === chosen) ? chosen : "";
  $("compare-choice").hidden = choices.length === 0;
  if (!pair) return;
  setText($("compare-how"), inWords(pair));
  $("compare-page").hidden = !pair.measured;
  $("compare-page").href = `./api/comparison.html?${new URLSearchParams({ first: pair.own.pulses.id, second: pair.other.pulses.id, language: languageInUse() })}`;
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

/** @param {string} id of the other jump; empty: none */
async function choose(id) {
  const kept = choices;
  leave();
  choices = kept;
  drawChoices();
  const beside = shown?.id;
  if (!id || !beside) return;
  $("compare").value = id;
  const found = await align(beside, id);
  if (shown?.id !== beside || $("compare").value !== id) return;
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
 * @param {string} own
 * @param {string} other
 */
async function align(own, other) {
  const both = [own, other];
  /** @type {Pulses[]} */
  const pulses = await Promise.all(both.map((id) => call("GET", recordingPath(id, "/pulses"))));
  /** @type {Moment[]} */
  let moments = await Promise.all(both.map((id) => call("GET", recordingPath(id, "/moment"))));
  if (moments.some(({ kind }) => kind !== "takeoff")) moments = await Promise.all(both.map((id) => call("GET", recordingPath(id, "/moment?by_motion=true"))));
  const kind = moments.some((moment) => moment.kind === "none") ? "none" : moments[0].kind;
  const [one, two] = both.map((_, place) => ({ pulses: pulses[place], zero_s: kind === "none" ? 0 : timeAt(pulses[place], moments[place]) }));
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
