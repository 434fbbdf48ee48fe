/** The state of the rig as colour, word and icon: large in the live view, small at the top where that is not in sight. */

import { say, t } from "../i18n/i18n.js";
import { $, setIcon, setText } from "../shared/dom.js";
import { clock, timeOfDay, who } from "../shared/format.js";
import { known, watch } from "../shared/store.js";

const ICONS = { idle: "idle", arming: "arming", armed: "armed", recording: "recording", disarming: "arming", fault: "fault", unknown: "arming" };

export function startState() {
  watch(draw);
  setInterval(drawTime, 250);
  const belowTop = { rootMargin: `-${document.querySelector(".top")?.clientHeight ?? 0}px 0px 0px`, threshold: 0.4 };
  new IntersectionObserver(([seen]) => document.body.classList.toggle("state-away", !seen.isIntersecting), belowTop).observe($("state"));
}

function draw() {
  const { status, connected } = known;
  const state = status?.state ?? "unknown";
  document.body.classList.toggle("stale", !connected);
  document.title = `${t(`state.${state}`)} – Svev`;
  for (const element of [$("state"), $("pill")]) {
    element.dataset.state = state;
    element.dataset.level = status?.statement.level ?? "";
    setIcon(element.querySelector("svg"), ICONS[state]);
  }
  setText($("state-word"), t(`state.${state}`));
  setText($("state-text"), inWords());
  $("state-text").dataset.level = status?.statement.level ?? "";
  drawNotice();
  drawTime();
}

/** What befell the last recording, where the state has something else to say. */
function drawNotice() {
  const { status } = known;
  const notice = status?.notice && status.notice.code !== status.statement.code ? status.notice : null;
  $("state-notice").hidden = !notice;
  setText($("state-notice"), notice ? asSentence(say(notice).text) : "");
}

function inWords() {
  const { status } = known;
  if (!status) return "";
  const { text, advice } = say(status.statement);
  const alarmed = status.alarms.some(({ statement }) => statement.code === status.statement.code);
  if (alarmed) return status.recording ? recordingInWords(status.recording) : asSentence(t("state.alarmed"));
  if (status.recording && status.statement.level === "good") return recordingInWords(status.recording);
  const todo = status.statement.level === "warning" ? "" : advice; // what to do about a missing camera stands on its card
  return [text, todo].filter(Boolean).map(asSentence).join(" ");
}

/** @param {import("../shared/types.js").Recording} recording */
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

/** Seconds recorded, counted on between two statuses so that the clock runs evenly. */
function recordedFor() {
  return (known.status?.recording?.duration_s ?? 0) + Math.min(2, (Date.now() - known.heard) / 1000);
}
