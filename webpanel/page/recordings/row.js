/** One recording in a list: its thumbnail, who jumped, facts, verdict. */

import { say, t } from "../i18n/i18n.js";
import { partOf } from "../shared/api.js";
import { icon, make, makeMark } from "../shared/dom.js";
import { length, size, timeOfDay, who } from "../shared/format.js";

/** @typedef {import("../shared/types.js").Recording} Recording */

/**
 * A summary of a recording that links to its view.
 *
 * @param {Recording} recording
 */
export function makeLink(recording) {
  const { id, session, started, duration_s, bytes, verdict, state, favourite, tags } = recording;
  const thumbnail = make("img", { class: "thumbnail", loading: "lazy", alt: "", width: 160, height: 90, src: partOf(id, "thumbnail.jpg") });
  thumbnail.addEventListener("error", () => thumbnail.classList.add("none"));
  const facts = [started ? timeOfDay(started) : id, length(duration_s), size(bytes)].join("  ·  ");
  return make("a", { class: "summary", href: `#/recordings/${encodeURIComponent(id)}` },
    thumbnail,
    make("span", { class: "summary-words" },
      make("strong", {}, who(session, t("recordings.nobody")), favourite ? makeStar() : null),
      make("span", { class: "summary-facts" }, facts),
      state === "recording" ? makeMark("recording", "error", t("state.recording")) : makeMark(verdict.level, verdict.level, say(verdict).text),
      tags.length ? make("span", { class: "tags" }, ...tags.map((tag) => make("span", {}, tag))) : null));
}

function makeStar() {
  const star = icon("star");
  star.setAttribute("class", "icon star");
  star.setAttribute("aria-hidden", "false");
  star.setAttribute("role", "img");
  star.setAttribute("aria-label", t("recording.favourite"));
  return star;
}
