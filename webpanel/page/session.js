/** Who jumps next, and the conditions. They carry over from jump to jump; "next jumper" clears who. */

import { call } from "./api.js";
import { $, setText } from "./dom.js";
import { inputOf, makeFields, readFields, writeFields } from "./fields.js";
import { t } from "./i18n.js";
import { load, save } from "./memory.js";
import { tellProblem } from "./snacks.js";
import { known, watch } from "./store.js";

/** "Next jumper" was pressed while a recording runs: what is written from then on is not about that one. */
let aboutNext = false;

export function startSession() {
  makeFields($("session").querySelector(".fields"), "session", changed);
  writeFields($("session"), load("session", {}));
  $("session").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    /** @type {HTMLElement} */ (document.activeElement).blur();
  });
  $("session").addEventListener("input", remember);
  $("next-jumper").addEventListener("click", nextJumper);
  watch(draw);
}

/** What goes into the next recording. */
export function sessionFields() {
  return readFields($("session"));
}

/** Clear bib and name, and begin to write the next bib. */
export function nextJumper() {
  for (const name of ["bib", "athlete"]) inputOf($("session"), name).value = "";
  remember();
  aboutNext = true;
  draw();
  inputOf($("session"), "bib").focus();
}

function draw() {
  const running = Boolean(known.status?.recording);
  aboutNext &&= running;
  setText($("session-title"), t(running && !aboutNext ? "session.this" : "session.title"));
}

function remember() {
  save("session", sessionFields());
}

/**
 * While a recording runs, what is changed belongs to it.
 *
 * @param {string} name
 * @param {string} value
 */
async function changed(name, value) {
  remember();
  const recording = known.status?.recording;
  if (!recording || aboutNext) return;
  try {
    await call("PATCH", `recordings/${encodeURIComponent(recording.id)}`, { [name]: value });
  } catch (error) {
    tellProblem(error);
  }
}
