/** Spoken notes of the recording shown: recorded at the pulse in sight, listened to, removed. */

import { t } from "../i18n/i18n.js";
import { call, partOf, recordingPath } from "../shared/api.js";
import { $, icon, make, setText } from "../shared/dom.js";
import { place } from "../shared/router.js";
import { attempt, tell } from "../shared/snacks.js";
import { pulseShown, showPulse } from "./scrubber.js";

/** @typedef {{ number: number, pulse: number, recorded: string, bytes: number }} VoiceNote */

const FORMAT = "audio/webm;codecs=opus";
/** Speech is clear with this, and two minutes are a quarter of what the service takes. */
const BITS_PER_S = 32_000;
const LONGEST_S = 120;
const UPLOAD_MS = 60_000;

/** Id of the recording whose notes are shown. */
let recording = "";
/** @type {VoiceNote[]} */
let voices = [];
/**
 * What listens, while somebody speaks.
 *
 * @type {MediaRecorder|null}
 */
let listening = null;
let began = 0;

export function startVoice() {
  $("voice").addEventListener("click", () => void (listening ? listening.stop() : speak()));
  setInterval(() => { if (listening) tick(); }, 200);
}

/**
 * Show the spoken notes of a recording; of none before they are there.
 *
 * @param {string} id
 */
export async function loadVoices(id) {
  if (recording !== id) {
    if (listening) listening.stop(); // what was said until now is kept, with the jump it is about
    show(id, []);
  }
  const loaded = await call("GET", recordingPath(id, "/voice-notes"));
  const news = JSON.stringify(loaded) !== JSON.stringify(voices);
  if (recording === id && news) show(id, loaded); // what is being listened to goes on
}

export function drawVoices() {
  show(recording, voices);
}

/** Show how long somebody has spoken, and end it when that is too long, or when something else is looked at. */
function tick() {
  const seconds = (performance.now() - began) / 1000;
  setText($("voice-words"), t("voice.stop", { seconds: Math.floor(seconds) }));
  if (seconds >= LONGEST_S || place().id !== recording) listening?.stop();
}

async function speak() {
  const pulse = pulseShown();
  if (pulse === null) return;
  if (!isSecureContext) return tell("warning", t("voice.why_https"), { words: t("voice.how"), action: () => { open("./docs"); } });
  if (!globalThis.MediaRecorder?.isTypeSupported(FORMAT)) return tell("warning", t("voice.unsupported"));
  /** @type {MediaStream} */
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({ audio: true });
  } catch (error) {
    const missing = error instanceof DOMException && error.name === "NotFoundError";
    return tell("error", t(missing ? "voice.no_microphone" : "voice.refused"));
  }
  listen(stream, recording, pulse);
}

/**
 * @param {MediaStream} stream
 * @param {string} id of the recording that the note is about
 * @param {number} pulse
 */
function listen(stream, id, pulse) {
  /** @type {Blob[]} */
  const parts = [];
  const recorder = new MediaRecorder(stream, { mimeType: FORMAT, audioBitsPerSecond: BITS_PER_S });
  recorder.ondataavailable = ({ data }) => parts.push(data);
  recorder.onstop = () => {
    for (const track of stream.getTracks()) track.stop();
    listening = null;
    drawButton();
    void attempt(() => keep(id, pulse, new Blob(parts, { type: "audio/webm" })));
  };
  [listening, began] = [recorder, performance.now()];
  recorder.start();
  drawButton();
}

/**
 * @param {string} id
 * @param {number} pulse
 * @param {Blob} said
 */
async function keep(id, pulse, said) {
  const changed = await call("POST", recordingPath(id, `/voice-notes?pulse=${pulse}`), said, UPLOAD_MS);
  if (recording === id) show(id, changed);
}

/** @param {number} number */
async function remove(number) {
  const id = recording;
  await attempt(async () => {
    const changed = await call("DELETE", recordingPath(id, `/voice-notes/${number}`));
    if (recording === id) show(id, changed);
  });
}

function drawButton() {
  $("voice").setAttribute("aria-pressed", String(listening !== null));
  if (listening) tick();
  else setText($("voice-words"), t(isSecureContext ? "voice.start" : "voice.needs_https"));
}

/**
 * @param {string} id
 * @param {VoiceNote[]} shown
 */
function show(id, shown) {
  [recording, voices] = [id, shown];
  drawButton();
  $("voices").replaceChildren(...voices.map(({ number, pulse }) => make(
    "li", {},
    make("button", { type: "button", class: "note", onclick: () => showPulse(pulse) }, make("b", {}, String(pulse))),
    make("audio", { controls: true, preload: "none", src: partOf(id, `voice-notes/${number}/sound.webm`), "aria-label": t("voice.listen", { pulse }) }),
    make("button", { type: "button", class: "square", "data-needs": "operate", "aria-label": t("voice.remove", { pulse }), onclick: () => void remove(number) }, icon("close")),
  )));
}
