/** The view of the doctor: runs it, and shows each finding (PASS, WARN or FAIL) with what to do. */

import { say, t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, icon, make, makeMark, setText } from "../shared/dom.js";
import { tellProblem } from "../shared/snacks.js";

/** The doctor writes to the disk and listens to the network for some seconds. */
const DEADLINE_MS = 90_000;
const LEVELS = { PASS: "good", WARN: "warning", FAIL: "error" };

/** @typedef {import("../shared/types.js").DoctorReport} DoctorReport */
/** @typedef {import("../shared/types.js").Finding} Finding */

/** @type {DoctorReport|null} */
let report = null;
let looking = false;

export function startDoctor() {
  $("doctor-run").addEventListener("click", look);
}

async function look() {
  looking = true;
  draw();
  try {
    report = await call("GET", "doctor", undefined, DEADLINE_MS);
  } catch (error) {
    tellProblem(error);
  } finally {
    looking = false;
    draw();
  }
}

export function draw() {
  $("doctor-run").disabled = looking;
  $("doctor-run").setAttribute("aria-busy", String(looking));
  setText($("doctor-run"), t(looking ? "doctor.looking" : report ? "doctor.again" : "doctor.run"));
  if (!report) return;
  const level = LEVELS[report.worst];
  $("doctor-worst").replaceChildren(makeMark(level, level, t(`doctor.${report.worst}`)));
  const graveFirst = [...report.findings].sort((a, b) => gravity(b) - gravity(a));
  $("doctor-findings").replaceChildren(make("ul", { class: "findings" }, ...graveFirst.map(makeFinding)));
}

/** @param {Finding} finding */
function gravity({ level }) {
  return Object.keys(LEVELS).indexOf(level);
}

/** @param {Finding} finding */
function makeFinding({ level, topic, code, what, remedy, values }) {
  const { text, advice } = say({ code, text: what, advice: remedy, values });
  return make("li", { class: "finding", "data-level": LEVELS[level] }, icon(LEVELS[level]),
    make("div", {}, make("p", {}, make("strong", {}, `${t(`doctor.mark_${level}`)} `), make("span", { class: "topic" }, t(`doctor.${topic}`))), make("p", {}, text), remedy ? make("p", { class: "advice" }, advice) : null));
}
