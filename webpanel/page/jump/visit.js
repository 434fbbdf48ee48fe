/**
 * One jump for the athlete who has scanned its code: pictures, figures, files. Whoever comes by a link sees nothing else of
 * the service, not even its state, so that this page asks for what it shows.
 */

import { languageInUse, say, t } from "../i18n/i18n.js";
import { call, partOf, Problem, recordingPath } from "../shared/api.js";
import { $, icon, make, setText } from "../shared/dom.js";
import { fillFigures, levelOf, MARKS, verdictOf } from "../shared/figures.js";
import { day, timeOfDay, timeOfMinute } from "../shared/format.js";
import { howFar, measurementOf, named } from "../shared/latest.js";
import { makeReplay } from "../shared/replay.js";
import { filesOf } from "../shared/resultfiles.js";
import { known } from "../shared/store.js";

/** So often it is asked again while the jump is being measured, or there is no connection, ms. */
const AGAIN_MS = 5000;
const UNFINISHED = ["none", "waiting", "measuring"];
/** Files that athletes open, in this order; others come after them, folded away. @type {[RegExp, string][]} */
const FILES = [
  [/^kinogram\.html$/, "visit.kinogram"], [/^report\.html$/, "measurement.report"], [/^overlay\.mp4$/, "measurement.video"],
];
/** Pictures that stand on the page itself. */
const PICTURE = /^kinogram(?:-\d+)?\.jpg$/;
/** What the browser shows itself instead of keeping it. */
const SHOWN = /\.(html|txt|mp4|jpg)$/;

/** @typedef {import("../shared/types.js").LastJump} LastJump */

/** @type {import("../shared/replay.js").Replay} */
let replay;
/** Number of the visit that began last: those before it are over. */
let visits = 0;
let id = "";
/** When the link ends; "": this browser is logged in. */
let ends = "";
/** @type {import("../shared/types.js").Recording|null} */
let recording = null;
/** @type {import("../shared/latest.js").Measured|null} */
let measured = null;
/** Number of the jump that is looked at, where the recording has several; 0: the last one, until somebody chooses. */
let chosen = 0;
/** Recording, files and language of what `drawFiles` has drawn. */
let drawn = "";
/** Why nothing more can be shown; null: all is well. @type {Problem|null} */
let wrong = null;

export function startVisit() {
  replay = makeReplay($("visit-replay"), { may: () => known.view === "jump", button: true });
}

/**
 * Show a jump.
 *
 * @param {string} recordingId
 * @param {string} key of the link; "": the link was opened before, or this browser is logged in
 */
export async function enterVisit(recordingId, key) {
  const own = ++visits;
  [id, ends, recording, measured, wrong, chosen] = [recordingId, "", null, null, null, 0];
  drawVisit();
  while (own === visits) {
    const again = await look(key, () => own === visits);
    if (own !== visits || !again) return;
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
  }
}

/** The page is left. */
export function leaveVisit() {
  visits += 1;
  replay.show("");
}

/**
 * @param {string} key
 * @param {() => boolean} wanted
 * @returns {Promise<boolean>} whether to ask again
 */
async function look(key, wanted) {
  try {
    if (key && !ends) {
      const visit = await call("POST", "login/link", { recording: id, key });
      if (wanted()) ends = visit.ends;
    }
    const [found, figures] = [await call("GET", recordingPath(id)), await measurementOf(id)];
    if (!wanted()) return false;
    [recording, measured, wrong] = [found, figures, null];
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (!wanted()) return false;
    wrong = error;
  }
  drawVisit();
  if (wrong) return wrong.status === 0 || wrong.status >= 500;
  return Boolean(measured?.renaming) || UNFINISHED.includes(measured?.state ?? "none");
}

/** Draw it, also anew in another language. */
export function drawVisit() {
  const all = measured?.figures ?? [];
  const figures = all.find(({ jump }) => jump === chosen) ?? all.at(-1) ?? null;
  const lost = wrong !== null && (wrong.status === 0 || wrong.status >= 500);
  const shown = wrong && !lost ? null : recording;
  setText($("visit-problem"), !wrong ? "" : lost ? t("visit.lost") : say(wrong.said).text);
  $("visit-problem").hidden = !wrong;
  $("visit-jump").hidden = !shown;
  setText($("visit-who"), shown ? named(shown.session) : "Svev");
  if (!shown) return replay.show("");
  replay.show(id, measured?.measured ?? "", figures?.jump);
  drawChoice(all, figures);
  setText($("visit-time"), shown.started ? `${day(shown.started)}, ${timeOfDay(shown.started)}` : "");
  const level = figures && levelOf(figures, measured?.live);
  setText($("visit-mark"), level ? t(MARKS[level]) : "");
  $("visit-mark").dataset.level = level ?? "";
  setText($("visit-far"), howFar(measured, Boolean(figures)));
  $("visit-why").hidden = !figures || figures.ok;
  setText($("visit-why"), figures && !figures.ok ? verdictOf(figures) : "");
  $("visit-figures").hidden = !figures;
  if (figures) fillFigures($("visit-figures"), figures);
  drawFiles(filesOf(measured?.files ?? [], figures ? all.indexOf(figures) + 1 : 1));
  setText($("visit-until"), ends ? t("visit.until", { day: day(ends), time: timeOfMinute(ends) }) : "");
  replay.draw();
}

/**
 * The jumps of the recording, if there are several: his own may be any of them.
 *
 * @param {LastJump[]} all
 * @param {LastJump|null} shown
 */
function drawChoice(all, shown) {
  const row = $("visit-choice");
  const focused = row.contains(document.activeElement);
  row.hidden = all.length < 2;
  row.replaceChildren(...all.map((each) => make("button", {
    type: "button", "aria-pressed": String(each === shown), onclick: () => { chosen = each.jump; drawVisit(); },
  }, t("measurement.jump", { jump: each.jump, time: timeOfDay(each.time) }))));
  if (focused) row.querySelector('[aria-pressed="true"]')?.focus({ preventScroll: true });
}

/** @param {string[]} files */
function drawFiles(files) {
  const now = JSON.stringify([languageInUse(), id, measured?.measured, files]);
  if (now === drawn) return;
  drawn = now;
  $("visit-pictures").replaceChildren(...files.filter((name) => PICTURE.test(name)).map(makePicture));
  const first = FILES.flatMap(([kind, words]) => files.filter((name) => kind.test(name)).map((name) => makeFile(name, t(words))));
  const rest = files.filter((name) => !PICTURE.test(name) && !FILES.some(([kind]) => kind.test(name))).map((name) => makeFile(name, name));
  $("visit-files").replaceChildren(...first);
  $("visit-others").replaceChildren(...rest);
  $("visit-more").hidden = !rest.length;
}

/** @param {string} name */
function makePicture(name) {
  const address = fileAddress(name);
  const again = () => setTimeout(() => { if (image.isConnected) image.src = address; }, AGAIN_MS);
  const image = make("img", { src: address, alt: t("visit.kinogram"), onerror: again }); // refused while a recording runs
  return make("a", { href: address, target: "_blank", rel: "noopener" }, image);
}

/** @param {string} name of a file */
function fileAddress(name) {
  return partOf(id, `measurement/files/${encodeURIComponent(name)}`);
}

/**
 * @param {string} name
 * @param {string} words
 */
function makeFile(name, words) {
  const how = SHOWN.test(name) ? { target: "_blank", rel: "noopener" } : { download: "" };
  return make("a", { class: "button", href: fileAddress(name), ...how },
    icon(SHOWN.test(name) ? "log" : "download"), make("span", {}, words));
}
