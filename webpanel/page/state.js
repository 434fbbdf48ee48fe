/** The one big state: colour, word and icon; and the same small at the top of every view. */

import { $, setIcon, setText } from "./dom.js";
import { clock, timeOfDay, who } from "./format.js";
import { say, t } from "./i18n.js";
import { known, watch } from "./store.js";

const ICONS = { idle: "idle", arming: "arming", armed: "armed", recording: "recording", disarming: "arming", fault: "fault", unknown: "arming" };

export function startState() {
  watch(draw);
  setInterval(drawTime, 250);
}

function draw() {
  const { status, connected } = known;
  const state = status?.state ?? "unknown";
  document.body.classList.toggle("stale", !connected);
  document.title = `${t(`state.${state}`)} – Svev`;
  for (const element of [$("state"), $("pill")]) {
    element.dataset.state = state;
    setIcon(element.querySelector("svg"), ICONS[state]);
  }
  setText($("state-word"), t(`state.${state}`));
  setText($("state-text"), inWords());
  $("state-text").dataset.level = status?.statement.level ?? "";
  drawTime();
}

function inWords() {
  const { status } = known;
  if (!status) return "";
  const { text, advice } = say(status.statement);
  if (status.recording && status.statement.level === "good") return recordingInWords(status.recording);
  const todo = status.statement.level === "warning" ? "" : advice; // of a missing camera its card says what to do
  return [text, todo].filter(Boolean).map(asSentence).join(" ");
}

/** @param {import("./types.js").Recording} recording */
function recordingInWords({ session, counts }) {
  const pulses = t(counts.partial ? "state.pulses_partial" : "state.pulses", { pulses: counts.pulses, partial: counts.partial });
  return [who(session, ""), pulses].filter(Boolean).join("  –  ");
}

/** @param {string} words */
function asSentence(words) {
  const text = words[0].toLocaleUpperCase() + words.slice(1);
  return /[.!?…]$/.test(text) ? text : `${text}.`;
}

function drawTime() {
  const { status, connected, heard } = known;
  const word = t(`state.${status?.state ?? "unknown"}`);
  setText($("state-time"), timeShown());
  const seconds = connected && status?.recording ? ` ${clock(recordedFor())}` : "";
  setText($("pill").querySelector("span"), word + seconds);
  if (!connected && heard) setText($("state-time"), t("lost.as_of", { time: timeOfDay(heard) }));
}

function timeShown() {
  return known.status?.recording ? clock(recordedFor()) : "";
}

/** Counted on between two pictures from the service, so that the clock runs evenly. */
function recordedFor() {
  return (known.status?.recording?.duration_s ?? 0) + Math.min(2, (Date.now() - known.heard) / 1000);
}
