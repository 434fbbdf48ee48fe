/** The state of the rig as colour, word and icon: large in the live view. Where that is not in sight, frame/pill.js shows it. */

import { say, t } from "../i18n/i18n.js";
import { $, setIcon, setText } from "../shared/dom.js";
import { clock, timeOfDay, who } from "../shared/format.js";
import { recordedFor, STATE_ICONS } from "../shared/state.js";
import { known, watch } from "../shared/store.js";

export function startState() {
  watch(draw);
  setInterval(drawTime, 250);
  const belowTop = { rootMargin: `-${document.querySelector(".top")?.clientHeight ?? 0}px 0px 0px`, threshold: 0.4 };
  new IntersectionObserver(([seen]) => document.body.classList.toggle("state-away", !seen.isIntersecting), belowTop).observe($("state"));
}

function draw() {
  const { status } = known;
  const state = status?.state ?? "unknown";
  $("state").dataset.state = state;
  $("state").dataset.level = status?.statement.level ?? "";
  setIcon($("state").querySelector("svg"), STATE_ICONS[state]);
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
  const recorded = status?.recording ? clock(recordedFor()) : "";
  setText($("state-time"), !connected && heard ? t("lost.as_of", { time: timeOfDay(heard) }) : recorded);
}
