/**
 * The next jumper: one in the service, whom all devices show and edit. What is typed goes there while it is typed.
 *
 * An edit is about the jumper whom the page showed when it was begun. If he begins to jump meanwhile, what was typed is
 * offered for his jump and never becomes the following jumper's. While somebody types in a field, it is left alone.
 */

import { t } from "../i18n/i18n.js";
import { call, Problem, recordingPath } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { inputOf, makeFields, writeFields } from "../shared/fields.js";
import { who } from "../shared/format.js";
import { attempt, tell, tellProblem } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";
import { nameOf } from "./listload.js";

/** @typedef {import("../shared/types.js").NextJumper} NextJumper */

/** A pause in typing after which it is sent. */
const PAUSE_MS = 250;

/** @type {NextJumper|null} the jumper whom the fields show */
let shown = null;
/** @type {Record<string, string>} what was typed about him and not sent yet, by field */
let typed = {};
/** @type {Record<string, string>} what is being sent */
let underway = {};
/** @type {Promise<boolean>|null} whether it was sent */
let sending = null;
let timer = 0;
/** The service could not be reached: what was typed is sent when it is there again. */
let stuck = false;

export function startSession() {
  makeFields($("session"), "session", () => void flush());
  $("session").addEventListener("input", (/** @type {InputEvent} */ event) => {
    const input = /** @type {HTMLInputElement} */ (event.target);
    typed[input.name] = input.value.trim();
    clearTimeout(timer);
    timer = setTimeout(flush, PAUSE_MS);
  });
  $("session").addEventListener("focusout", () => setTimeout(draw));
  $("next-jumper").addEventListener("click", nextJumper);
  watch(draw);
}

/**
 * Take over a newer next jumper than the page knows, from the answer to a call.
 *
 * @param {NextJumper} jumper
 */
export function adopt(jumper) {
  if (known.status && jumper.version > known.status.next_jumper.version) {
    update({ status: { ...known.status, next_jumper: jumper } });
  }
}

/** Pass over the next jumper; without a start list: clear bib and name, and put the cursor into the bib. */
export async function nextJumper() {
  if (known.status?.next_jumper.line != null) {
    await flush();
    const list = await attempt(() => call("POST", "next-jumper/skip", { number: shown?.number }));
    if (list) adopt(list.next);
    return;
  }
  for (const name of ["bib", "athlete"]) {
    inputOf($("session"), name).value = "";
    typed[name] = "";
  }
  inputOf($("session"), "bib").focus();
  await flush();
}

/** Send what was typed; returns when the service has it, or has refused it. */
export async function flush() {
  clearTimeout(timer);
  while (sending || Object.keys(typed).length) {
    sending ??= send().finally(() => { sending = null; });
    if (!await sending) return;
  }
}

async function send() {
  const about = shown;
  [underway, typed] = [typed, {}];
  try {
    const jumper = await call("PATCH", "next-jumper", { ...underway, ...(about ? { number: about.number } : {}) });
    underway = {};
    shown = jumper; // a bib may have made it another line's jumper: what is typed on is about him
    adopt(jumper);
  } catch (error) {
    const unsent = underway;
    underway = {};
    if (error instanceof Problem && error.code === "changed_meanwhile") {
      offer(about, unsent);
    } else {
      if (error instanceof Problem && error.status === 0) [typed, stuck] = [{ ...unsent, ...typed }, true];
      tellProblem(error);
      return false;
    }
  }
  draw();
  return true;
}

/**
 * Say that a jumper began to jump while something was typed about him, and offer to write it into his jump.
 *
 * @param {NextJumper|null} jumper
 * @param {Record<string, string>} fields
 */
function offer(jumper, fields) {
  const name = who(jumper?.session ?? { bib: "", athlete: "" }, t("recordings.nobody"));
  const id = known.status?.recording?.id ?? known.status?.last_recording;
  const words = t("session.late", { who: name, what: Object.values(fields).filter(Boolean).join(", ") });
  if (!id || !Object.values(fields).some(Boolean)) return;
  tell("warning", words, {
    words: t("session.late_write"),
    action: () => void attempt(() => call("PATCH", recordingPath(id), fields)),
  });
}

function draw() {
  const { status } = known;
  if (!status) return;
  if (stuck && known.connected) {
    stuck = false;
    void flush();
  }
  // While an edit is under way nobody knows whether another number is its doing: a bib may be that of another line.
  const waits = Object.keys(underway).length > 0 && status.next_jumper.number !== shown?.number;
  if (!waits && (!shown || status.next_jumper.version >= shown.version)) show(status.next_jumper);
  const running = status.recording;
  $("jumping").hidden = !running;
  if (running) {
    $("jumping").href = `#/recordings/${encodeURIComponent(running.id)}`;
    setText($("jumping"), t("session.running", { who: who(running.session, t("recordings.nobody")) }));
  }
  const { line, more } = status.next_jumper;
  setText($("next-jumper").querySelector("span"), t(line === null ? "session.next" : "session.skip"));
  setText($("session-more"), Object.entries(more).map(([column, text]) => `${nameOf(column)}: ${text}`).join("  ·  "));
}

/** @param {NextJumper} jumper */
function show(jumper) {
  const another = shown?.number !== jumper.number;
  if (another && shown && Object.keys(typed).length) {
    offer(shown, typed);
    typed = {};
    clearTimeout(timer);
  }
  shown = jumper;
  if (another) {
    for (const [name, value] of Object.entries(jumper.session)) inputOf($("session"), name).value = value;
    return;
  }
  const left = { ...jumper.session };
  for (const name of Object.keys({ ...typed, ...underway })) delete left[/** @type {keyof typeof left} */ (name)];
  writeFields($("session"), left);
}
