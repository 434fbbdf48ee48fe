/** The session fields of the live view. They stay from jump to jump; "next jumper" clears bib and name. */

import { t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { inputOf, makeFields, readFields, writeFields } from "../shared/fields.js";
import { attempt } from "../shared/snacks.js";
import { known, load, save, watch } from "../shared/store.js";

/** "Next jumper" was pressed while a recording runs: what is entered from then on belongs to the next recording. */
let aboutNext = false;

export function startSession() {
  makeFields($("session"), "session", changed);
  writeFields($("session"), load("session", {}));
  $("session").addEventListener("input", remember);
  $("next-jumper").addEventListener("click", nextJumper);
  watch(draw);
}

/** The fields for the next recording. */
export function sessionFields() {
  return readFields($("session"));
}

/** Clear bib and name, and put the cursor into the field of the bib. */
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
 * A field was changed. While a recording runs, the change belongs to that recording.
 *
 * @param {string} name
 * @param {string} value
 */
async function changed(name, value) {
  remember();
  const recording = known.status?.recording;
  if (recording && !aboutNext) await attempt(() => call("PATCH", recordingPath(recording.id), { [name]: value }));
}
