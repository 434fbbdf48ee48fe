/** Exports of the recording shown: ask for a video, pictures or a table, see how far it is, fetch it. */

import { languageInUse, say, t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { $, icon, make } from "../shared/dom.js";
import { number, size } from "../shared/format.js";
import { place } from "../shared/router.js";
import { attempt } from "../shared/snacks.js";
import { beginMarking, mark, marked, startMarking } from "../viewing/marking.js";

/** @typedef {{ id: string, recording: string, state: string, done: number, pulses: number, name: string, bytes: number, problem: import("../shared/types.js").Phrase|null }} ExportJob */

const KINDS = ["h264", "ffv1", "png", "tiff", "csv", "contact_sheet"];
const SLOW = [1, 2, 3, 5, 10];
const QUALITIES = ["small", "good", "best"];
const VIDEOS = ["h264", "ffv1"];
const OVER = ["done", "failed"];
const LOOK_MS = 1000;

/** Id of the recording whose exports are shown. */
let recording = "";
/** @type {string[]} */
let cameras = [];
/** @type {ExportJob[]} */
let jobs = [];
/** @type {number|undefined} */
let timer;

export function startExports() {
  drawExports();
  startMarking(drawStretch);
  for (const end of /** @type {const} */ (["first", "last"])) {
    $(`export-${end}`).addEventListener("change", () => mark(end, $(`export-${end}`).valueAsNumber || null));
  }
  $("export-kind").addEventListener("change", drawFitting);
  $("export-form").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    void ask();
  });
}

/**
 * Show the exports of a recording.
 *
 * @param {string} id
 * @param {import("../shared/types.js").Pulses} shown its pulses
 */
export async function loadExports(id, shown) {
  if (recording !== id) jobs = [];
  [recording, cameras] = [id, shown.cameras];
  beginMarking(shown.pulses.map(({ pulse }) => pulse));
  drawExports();
  await attempt(look);
}

/** Draw everything, perhaps in another language. */
export function drawExports() {
  fill("export-kind", KINDS, (kind) => t(`export.${kind}`), "h264");
  fill("export-camera", ["", ...cameras], (name) => name || t("scrub.all"), "");
  fill("export-slow", SLOW.map(String), (factor) => (factor === "1" ? t("scrub.normal") : `1/${factor}`), "1");
  fill("export-quality", QUALITIES, (quality) => t(`export.${quality}`), "good");
  drawFitting();
  drawJobs();
}

/** Switch off what does not fit the kind. */
function drawFitting() {
  const kind = $("export-kind").value;
  for (const id of ["export-slow", "export-burn"]) $(id).disabled = !VIDEOS.includes(kind);
  $("export-quality").disabled = kind !== "h264";
  $("export-camera").disabled = kind === "contact_sheet";
}

/** Show the pulses that are marked in the fields, too. */
function drawStretch() {
  const { first, last } = marked();
  [$("export-first").value, $("export-last").value] = [first ?? "", last ?? ""];
}

async function ask() {
  const [kind, camera] = [$("export-kind").value, $("export-camera").value];
  const order = {
    kind, cameras: camera && kind !== "contact_sheet" ? [camera] : [], ...marked(), quality: $("export-quality").value,
    slow: VIDEOS.includes(kind) ? Number($("export-slow").value) : 1, burn_in: VIDEOS.includes(kind) && $("export-burn").checked,
    language: languageInUse(),
  };
  await attempt(async () => {
    await call("POST", recordingPath(recording, "/exports"), order);
    await look();
  });
}

/** Look how far the exports are, again and again while one is not over and the recording is shown. */
async function look() {
  clearTimeout(timer);
  const id = recording;
  const all = /** @type {ExportJob[]} */ (await call("GET", "exports"));
  if (recording !== id) return;
  jobs = all.filter((job) => job.recording === id);
  drawJobs();
  if (jobs.some(({ state }) => !OVER.includes(state)) && place().id === id) timer = setTimeout(() => void attempt(look), LOOK_MS);
}

function drawJobs() {
  $("exports").replaceChildren(...jobs.map((job) => make(
    "li", { "data-state": job.state },
    make("span", {}, job.name, make("small", {}, words(job))),
    job.state === "done" ? make("a", { class: "button", href: `./api/exports/${job.id}/file`, download: "" }, icon("download"), make("span", {}, t("recording.download"))) : null,
    make("button", { type: "button", class: "square", "aria-label": t(OVER.includes(job.state) ? "export.remove" : "export.cancel"), onclick: () => void remove(job.id) }, icon("close")),
  )));
}

/** @param {ExportJob} job */
function words({ state, done, pulses, bytes, problem }) {
  if (state === "done") return size(bytes);
  if (state === "failed") return problem ? say(problem).text : "";
  const part = pulses ? ` ${number((100 * done) / pulses)} %` : "";
  return t(`export.${state}`) + part;
}

/** @param {string} id */
async function remove(id) {
  await attempt(async () => {
    await call("DELETE", `exports/${id}`);
    await look();
  });
}

/**
 * Fill a choice, and keep what is chosen.
 *
 * @param {string} id
 * @param {string[]} values
 * @param {(value: string) => string} named
 * @param {string} otherwise what is chosen if nothing is yet
 */
function fill(id, values, named, otherwise) {
  const chosen = $(id).value;
  $(id).replaceChildren(...values.map((value) => make("option", { value }, named(value))));
  $(id).value = values.includes(chosen) ? chosen : otherwise;
}
