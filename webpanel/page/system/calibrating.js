/** The calibration helper: says what to show next, which pictures were kept, and what came of them. */

import { say, t } from "../i18n/i18n.js";
import { API, call } from "../shared/api.js";
import { $, fillList, make, makeMark, setText } from "../shared/dom.js";
import { number, quantity } from "../shared/format.js";
import { attempt } from "../shared/snacks.js";
import { known, watch } from "../shared/store.js";
import { drawCovered, drawResiduals } from "./lensdrawing.js";

/** The fields that say what was printed, by what follows `calibrating-` in their names. */
const FIELDS = ["columns", "rows", "square", "target"];
/** Between two looks at what the helper sees, and at one that does nothing. */
const OFTEN_MS = 400;
const SELDOM_MS = 5000;
/** It has the processor time that nobody else wants: an order may wait for the disk, and for what runs to end. */
const DEADLINE_MS = 30_000;

/** @typedef {import("./types.js").Calibrating} Calibrating */
/** @typedef {import("./types.js").SeenTarget} SeenTarget */

/** Name of the camera that is shown. */
let camera = "";
/** @type {Calibrating|null} */
let helper = null;
let running = false;
let ordered = false;
/** How many orders were given: an answer that was asked for before the last one is old. */
let orders = 0;
/** What the drawings show now, so that they are not drawn again. */
let drawn = "";
/** Of what the pictures are, as the fields show it: another tab, or this page before it was loaded anew, may have said so. */
let filled = "";

export function startCalibrating() {
  $("calibrating-begin").addEventListener("click", () => begin(false));
  $("calibrating-anew").addEventListener("click", () => begin(true));
  $("calibrating-stop").addEventListener("click", () => void order("DELETE", "calibration"));
  $("calibrating-undo").addEventListener("click", () => void order("DELETE", "calibration/pictures/last"));
  $("calibrating-compute").addEventListener("click", () => void order("POST", "calibration/compute"));
  $("calibrating-save").addEventListener("click", () => void order("POST", "calibration/save"));
  $("calibrating-protocol").href = `${API}calibration/protocol.html`;
  watch(() => { if (wanted() && !running) void run(); });
}

/**
 * Show the helper for a camera.
 *
 * @param {string} name
 */
export function calibratingOf(name) {
  camera = name;
  drawCalibrating();
}

function wanted() {
  return known.connected && known.visible && known.view === "aim";
}

/** Ask what the helper sees, again and again; that keeps it going. */
async function run() {
  running = true;
  while (wanted()) {
    const before = orders;
    const found = await attempt(() => call("GET", "calibration"));
    if (found && before === orders) enter(found);
    await new Promise((resolve) => { setTimeout(resolve, found && isWorking() ? OFTEN_MS : SELDOM_MS); });
  }
  running = false;
}

function isWorking() {
  return ["looking", "held", "computing"].includes(helper?.state ?? "");
}

/**
 * @param {string} method
 * @param {string} path
 * @param {object} [body]
 */
async function order(method, path, body) {
  if (ordered) return; // a double tap
  ordered = true;
  orders += 1;
  drawCalibrating();
  const found = await attempt(() => call(method, path, body, DEADLINE_MS));
  ordered = false;
  orders += 1;
  if (found) enter(found);
  else drawCalibrating();
}

/** @param {boolean} anew */
function begin(anew) {
  const wrong = FIELDS.map((name) => $(`calibrating-${name}`)).find((field) => !field.checkValidity());
  if (wrong) {
    wrong.closest("details").open = true; // a field that is not seen cannot say what it wants
    wrong.reportValidity();
  } else void order("POST", "calibration", printed(anew));
}

/** @param {boolean} anew */
function printed(anew) {
  const [columns, rows, square, target] = FIELDS.map((name) => $(`calibrating-${name}`).valueAsNumber);
  return { columns, rows, square_mm: square, target_mm: target, anew };
}

/** @param {Calibrating} found */
function enter(found) {
  const concluded = helper?.state === "computing" && (found.state === "done" || found.state === "failed");
  helper = found;
  const now = JSON.stringify(found.printed);
  if (found.printed && now !== filled) {
    const { columns, rows, square_mm: square, target_mm: target } = found.printed;
    [columns, rows, square, target].forEach((value, index) => { $(`calibrating-${FIELDS[index]}`).value = String(value); });
    filled = now;
  }
  if (concluded) requestAnimationFrame(() => $("calibrating").scrollIntoView()); // what was hidden above it is there again
  drawCalibrating();
}

export function drawCalibrating() {
  if (known.view !== "aim") return;
  const state = helper?.state ?? "off";
  const looking = state === "looking" || state === "held";
  const seen = helper?.cameras.find((each) => each.camera === camera) ?? null;
  const taken = helper?.taken ?? 0;
  $("calibrating-fields").disabled = ordered || isWorking();
  $("calibrating-begin").hidden = isWorking();
  setText($("calibrating-begin"), t(taken ? "calibrating.go_on" : "calibrating.begin"));
  $("calibrating-anew").hidden = isWorking() || !taken;
  $("calibrating-stop").hidden = !isWorking();
  $("calibrating-undo").hidden = !taken || state === "computing" || (helper?.saved ?? false);
  $("calibrating-compute").hidden = !taken || state === "computing" || state === "done";
  for (const name of ["begin", "anew", "stop", "undo", "compute", "save"]) $(`calibrating-${name}`).disabled = ordered;
  $("aim").classList.toggle("helping", isWorking());
  drawSaid(state, seen, taken);
  drawNext(looking ? seen : null);
  const cells = (seen?.cells ?? []).flat();
  $("calibrating-counts").hidden = !taken && !looking;
  fillList($("calibrating-counts"), [
    [t("calibrating.pulses"), number(taken)],
    [t("calibrating.pictures", { camera }), number(seen?.pictures ?? 0)],
    [t("calibrating.covered"), quantity(cells.length ? 100 * cells.filter(Boolean).length / cells.length : 0, 0, "%")],
  ]);
  drawResult(seen);
  const over = $("calibrating-over");
  over.toggleAttribute("hidden", !looking || !seen);
  if (looking && seen) drawCovered(over, seen, true);
}

/**
 * One sentence: what the helper does, or what to do.
 *
 * @param {string} state
 * @param {SeenTarget|null} seen
 * @param {number} taken
 */
function drawSaid(state, seen, taken) {
  const problem = helper?.problem ? say(helper.problem) : null;
  let words = taken ? t("calibrating.off", { count: taken }) : "";
  if (state === "held" || state === "computing" || state === "failed") words = t(`calibrating.${state}`);
  else if (state === "done") words = "";
  else if (state === "looking" && !["armed", "recording"].includes(known.status?.state ?? "")) words = t("calibrating.unarmed");
  else if (state === "looking" && helper?.full) words = t("calibrating.full");
  else if (state === "looking" && !seen?.corners.length) words = t("calibrating.unseen", { camera });
  else if (state === "looking") words = t(helper?.still ? "calibrating.still" : "calibrating.moving");
  setText($("calibrating-said"), words);
  $("calibrating-said").hidden = !words;
  $("calibrating-said").dataset.level = state === "failed" ? "error" : helper?.still ? "good" : "info";
  setText($("calibrating-problem"), problem ? [problem.text, problem.advice].filter(Boolean).join(": ") : "");
  $("calibrating-problem").hidden = !problem;
}

/** @param {SeenTarget|null} seen */
function drawNext(seen) {
  $("calibrating-next").hidden = !seen;
  if (!seen) return;
  const lines = seen.missing.map((each) => say(each).text);
  fillLines($("calibrating-missing"), lines.length ? lines : [t("calibrating.enough", { camera })]);
}

/**
 * @param {Element} list
 * @param {string[]} lines
 */
function fillLines(list, lines) {
  if (list.children.length !== lines.length) list.replaceChildren(...lines.map(() => make("li")));
  lines.forEach((line, index) => setText(list.children[index], line));
}

/** @param {SeenTarget|null} seen */
function drawResult(seen) {
  const lenses = helper?.state === "done" ? helper.lenses : [];
  $("calibrating-result").hidden = !lenses.length;
  $("calibrating-save").hidden = helper?.saved ?? false;
  $("calibrating-saved").hidden = !helper?.saved;
  const state = JSON.stringify([camera, lenses, seen?.cells, document.documentElement.lang]);
  if (!lenses.length || state === drawn) return;
  drawn = state;
  $("calibrating-lenses").replaceChildren(...lenses.map((lens) => make("div", { class: "lens", "data-level": lens.good ? "good" : "warning" },
    makeMark(lens.good ? "good" : "warning", lens.good ? "good" : "warning", `${lens.camera}: ${t(lens.good ? "calibrating.good" : "calibrating.poor")}`),
    make("p", {}, say(lens.verdict).text),
    lens.advice.length ? make("ul", {}, ...lens.advice.map((each) => make("li", {}, say(each).text))) : null)));
  const lens = lenses.find((each) => each.camera === camera);
  $("calibrating-drawings").hidden = !lens || !seen;
  if (!lens || !seen) return;
  drawCovered($("calibrating-coverage"), seen, false);
  setText($("calibrating-coverage-words"), t("calibrating.coverage", { camera }));
  const { times, longest } = drawResiduals($("calibrating-residuals"), seen, lens.residuals);
  setText($("calibrating-residuals-words"), t("calibrating.residuals", { camera, times, longest: number(longest, 3) }));
}
