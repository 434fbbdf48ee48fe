/** Notes at single pulses of the recording shown: written at the pulse that is in sight, tapped to go there. */

import { t } from "../i18n/i18n.js";
import { call, recordingPath } from "../shared/api.js";
import { $, icon, make } from "../shared/dom.js";
import { attempt } from "../shared/snacks.js";
import { pulseShown, showPulse } from "./scrubber.js";

/** @typedef {{ pulse: number, text: string }} Note */

/** Id of the recording whose notes are shown. */
let recording = "";
/** @type {Note[]} */
let notes = [];

export function startNotes() {
  $("note-form").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    void add();
  });
}

/**
 * Show the notes of a recording; of none before they are there.
 *
 * @param {string} id
 */
export async function loadNotes(id) {
  if (recording !== id) show(id, []);
  const loaded = await call("GET", recordingPath(id, "/notes"));
  if (recording === id) show(id, loaded);
}

/** Begin to write a note at the pulse in sight. */
export function beginNote() {
  $("note-text").focus();
}

export function drawNotes() {
  show(recording, notes);
}

async function add() {
  const text = $("note-text").value.trim();
  const pulse = pulseShown();
  if (!text || pulse === null) return;
  const id = recording;
  await attempt(async () => {
    const changed = await call("PUT", recordingPath(id, `/notes/${pulse}`), { text });
    if (recording !== id) return;
    $("note-text").value = "";
    $("note-text").blur();
    show(id, changed);
  });
}

/** @param {number} pulse */
async function remove(pulse) {
  const id = recording;
  await attempt(async () => {
    const changed = await call("DELETE", recordingPath(id, `/notes/${pulse}`));
    if (recording === id) show(id, changed);
  });
}

/**
 * @param {string} id
 * @param {Note[]} shown
 */
function show(id, shown) {
  [recording, notes] = [id, shown];
  $("notes").replaceChildren(...notes.map(({ pulse, text }) => make(
    "li", {},
    make("button", { type: "button", class: "note", onclick: () => showPulse(pulse) }, make("b", {}, String(pulse)), make("span", {}, text)),
    make("button", { type: "button", class: "square", "data-needs": "operate", "aria-label": t("note.remove", { pulse }), onclick: () => void remove(pulse) }, icon("close")),
  )));
}
