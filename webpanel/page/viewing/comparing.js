/** A second jump beside the one shown, aligned with it at the take-off, or where most moves. */

import { t } from "../i18n/i18n.js";
import { call, callForPage, partOf, recordingPath } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { day, number, who } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";
import { makeViewer } from "../shared/viewer.js";
import { onShown, sinceMoment } from "./scrubber.js";

/** @typedef {import("../shared/types.js").Recording} Recording */
/** @typedef {import("../shared/types.js").Pulses} Pulses */

/** So many jumps can be chosen among, the newest. */
const CHOICES = 100;

/** @type {import("../shared/viewer.js").Viewer} */
let viewer;
/** The other jump, and the index of the pulse at which it begins to matter; null: none is shown. @type {{ pulses: Pulses, moment: number }|null} */
let other = null;
/** Id of the jump shown. */
let shown = "";
/** @type {Recording[]} */
let choices = [];
let loading = false;

export function startComparing() {
  viewer = makeViewer($("other-frames"), () => {});
  $("compare").addEventListener("change", () => void attempt(() => choose($("compare").value)));
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
  if (shown !== recording.id) leave();
  shown = recording.id;
  const { items } = await callForPage(`recordings?limit=${CHOICES}`);
  if (shown !== recording.id) return;
  const same = (/** @type {Recording} */ { session }) => Number(session.athlete === recording.session.athlete);
  choices = items.filter((/** @type {Recording} */ each) => each.id !== shown && each.counts.pulses && each.state !== "recording");
  choices.sort((one, two) => same(two) - same(one));
  drawChoices();
}

/** Draw the choice, perhaps in another language. */
export function drawChoices() {
  const chosen = other?.pulses.id ?? "";
  $("compare").replaceChildren(
    make("option", { value: "" }, t("compare.none")),
    ...choices.map(({ id, session, started }) => make("option", { value: id }, `${who(session, id)}${started ? `, ${day(started)}` : ""}`)),
  );
  $("compare").value = choices.some(({ id }) => id === chosen) ? chosen : "";
  $("compare-choice").hidden = choices.length === 0;
}

function leave() {
  other = null;
  choices = [];
  loading = false;
  viewer.image.removeAttribute("src");
  $("other").hidden = true;
  $("both").classList.remove("two");
  drawChoices();
}

/** @param {string} id of the other jump; empty: none */
async function choose(id) {
  const kept = choices;
  leave();
  choices = kept;
  drawChoices();
  if (!id) return;
  $("compare").value = id;
  const beside = shown;
  const pulses = /** @type {Pulses} */ (await call("GET", recordingPath(id, "/pulses")));
  const { pulse } = await call("GET", recordingPath(id, "/moment"));
  if (shown !== beside || $("compare").value !== id) return;
  other = { pulses, moment: Math.max(0, pulses.pulses.findIndex((each) => each.pulse === pulse)) };
  viewer.layOut(pulses.cameras.map((name, index) => ({ name, columns: pulses.columns[index] })), pulses.shape[0]);
  $("other").hidden = false;
  $("both").classList.add("two");
  draw();
}

/** Show the pulse of the other jump that is as long after its moment as the one in sight is after its own. */
function draw() {
  if (!other) return;
  const { since_s, camera } = sinceMoment();
  const { id, pulses, cameras } = other.pulses;
  const time_s = pulses[other.moment].time_s + since_s;
  const later = pulses.findIndex((each) => each.time_s >= time_s);
  let index = later < 0 ? pulses.length - 1 : later;
  if (index > 0 && time_s - pulses[index - 1].time_s < pulses[index].time_s - time_s) index -= 1;
  const { pulse, statuses } = pulses[index];
  viewer.select(camera !== null && camera < cameras.length ? camera : null);
  statuses.forEach((status, place) => viewer.cover(place, "warning", status === "ok" ? "" : t(`status.${status}`), "", ""));
  viewer.image.alt = t("scrub.alt", { pulse });
  setText($("other-where"), t("compare.where", { pulse, since: number(pulses[index].time_s - pulses[other.moment].time_s, 3) }));
  const address = new URL(partOf(id, `pulses/${pulse}.jpg`), document.baseURI).href;
  if (loading || viewer.image.src === address) return;
  loading = true;
  viewer.image.src = address;
}
