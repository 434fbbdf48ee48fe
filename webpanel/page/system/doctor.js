/** The view of the doctor: runs it, and shows each finding (PASS, WARN or FAIL) with what to do. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, makeMark, setText } from "../shared/dom.js";
import { tellProblem } from "../shared/snacks.js";
import { LEVELS, makeFindings } from "./findings.js";

/** The doctor writes to the disk and listens to the network for some seconds. */
const DEADLINE_MS = 90_000;

/** @typedef {import("../shared/types.js").DoctorReport} DoctorReport */

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
  $("doctor-findings").replaceChildren(makeFindings(report.findings));
}
