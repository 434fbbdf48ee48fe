/** The list of what can be measured: one is selected, and the list says what is known of each in this pulse. */

import { t } from "../../i18n/i18n.js";
import { $, make, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { BY_HAND, remove, select, setSigma, setState, target, toggleGuess } from "../marking/marking.js";
import { said } from "../session/advance.js";
import { cameras, change, listed, state, thingOf, watch } from "../session/state.js";
import { colourOf } from "../views/overlay.js";

/** Words for the things that every log has; the others have the title that the service gives. @type {Record<string, string>} */
const TITLES = {
  P1: "digitize.P1", P2: "digitize.P2", P3: "digitize.P3", P4: "digitize.P4",
  "right ski": "digitize.right_ski", "left ski": "digitize.left_ski",
  "mark:right shoulder": "digitize.right_shoulder", "mark:left shoulder": "digitize.left_shoulder",
  "mark:right elbow": "digitize.right_elbow", "mark:left elbow": "digitize.left_elbow",
  "mark:right wrist": "digitize.right_wrist", "mark:left wrist": "digitize.left_wrist",
  "mark:right hip": "digitize.right_hip", "mark:left hip": "digitize.left_hip",
  "mark:right knee": "digitize.right_knee", "mark:left knee": "digitize.left_knee",
  "mark:right ankle": "digitize.right_ankle", "mark:left ankle": "digitize.left_ankle",
};
/** @type {Record<string, string>} */
const GROUPS = { jumper: "digitize.group_jumper", body: "digitize.group_body", balls: "digitize.group_balls" };
/** What the list writes of a thing in a view: a sign, and the words for it. @type {Record<string, [string, string]>} */
export const SIGNS = {
  m: ["●", "digitize.is_m"], r: ["◉", "digitize.is_r"], t: ["◆", "digitize.is_t"], a: ["■", "digitize.is_a"],
  g: ["?", "digitize.is_g"], h: ["–", "digitize.is_h"], n: ["∅", "digitize.is_n"], "": ["·", "digitize.is_none"],
};

/** @param {string} thing */
export function titleOf(thing) {
  return TITLES[thing] ? t(TITLES[thing]) : thingOf(thing)?.title ?? thing;
}

/** @param {string} group */
function titleOfGroup(group) {
  return GROUPS[group] ? t(GROUPS[group]) : group;
}

export function startThings() {
  $("group").addEventListener("change", () => {
    change({ group: $("group").value });
    const first = listed()[0];
    if (first) select({ thing: first.name });
  });
  $("advance").addEventListener("change", () => change({ advance: $("advance").value }));
  $("sigma").addEventListener("change", () => setSigma(Number($("sigma").value)));
  $("act-hidden").addEventListener("click", () => setState("hidden"));
  $("act-not-visible").addEventListener("click", () => setState("not visible"));
  $("act-guess").addEventListener("click", toggleGuess);
  $("act-remove").addEventListener("click", remove);
  watch(draw);
}

/** What the list shows now; it is made anew only when that changes. */
let shown = "";

function draw() {
  drawMark();
  if (document.activeElement !== $("advance")) $("advance").value = state.advance;
  const groups = [...new Set(state.opening?.things.map(({ group }) => group))];
  const rows = listed().map((thing) => ({ thing: thing.name, title: titleOf(thing.name), letters: cameras().map((camera) => letter(camera, thing.name)) }));
  const now = JSON.stringify([state.group, groups.map(titleOfGroup), rows, state.thing, cameras()]);
  if (now === shown) return;
  shown = now;
  $("group").replaceChildren(...groups.map((group) => make("option", { value: group }, titleOfGroup(group))));
  $("group").value = state.group;
  const focused = document.activeElement?.closest("[data-thing]")?.getAttribute("data-thing");
  $("things").replaceChildren(...rows.map(({ thing, title, letters }) => {
    const signs = letters.map((one, index) => make("span", { class: "sign", title: `${cameras()[index]}: ${t(SIGNS[one][1])}`, "data-letter": one }, SIGNS[one][0]));
    const words = letters.map((one, index) => `${cameras()[index]} ${t(SIGNS[one][1])}`).join(", ");
    const dot = make("i", {});
    dot.style.background = colourOf(thing);
    return make("li", {}, make("button", {
      type: "button", class: "thing", "data-thing": thing, "aria-pressed": String(thing === state.thing), "aria-label": `${title}: ${words}`, onclick: () => select({ thing }),
    }, dot, make("span", {}, title), make("span", { class: "signs" }, ...signs)));
  }));
  if (focused) /** @type {HTMLElement|null} */ (document.querySelector(`[data-thing="${CSS.escape(focused)}"]`))?.focus();
}

/** @param {string} camera @param {string} thing */
function letter(camera, thing) {
  const of = state.session?.coverage[thing]?.[camera]?.[state.pulse];
  return of ?? (said(state.view, camera, thing) ? "m" : "");
}

/** The mark on which keys act. */
function drawMark() {
  const mark = target();
  $("guess-next").hidden = !state.guess;
  $("sigma").disabled = !mark;
  if (document.activeElement !== $("sigma")) $("sigma").value = mark ? String(Math.round(1000 * (mark.sigma?.[0] ?? BY_HAND)) / 1000) : "";
  setText($("mark-words"), mark?.xy
    ? t("digitize.mark_at", { thing: titleOf(mark.thing), camera: mark.camera, x: number(mark.xy[0], 2), y: number(mark.xy[1], 2) })
    : t("digitize.mark_none", { thing: titleOf(state.thing), camera: state.camera }));
}
