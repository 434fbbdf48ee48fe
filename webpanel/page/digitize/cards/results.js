/** Computes the jump from what is measured by hand: verdict, coach's page, and files. */

import { say, t } from "../../i18n/i18n.js";
import { $, icon, make, setText } from "../../shared/dom.js";
import { attempt } from "../../shared/snacks.js";
import { cancelComputing, compute, getResult, resultFile } from "../session/server.js";
import { state, watch } from "../session/state.js";

const LOOK_AGAIN_MS = 1000;

/** @type {import("../types.js").HandResult|null} */
let result = null;
let looking = "";

export function startResults() {
  $("compute").addEventListener("click", () => void begin());
  $("compute-cancel").addEventListener("click", () => void cancel());
  watch(() => {
    if (state.operator && looking !== state.operator) void follow(state.operator);
  });
}

/** Compute; the result comes when it is there. */
export async function begin() {
  const answer = await attempt(() => compute(state.operator));
  if (!answer) return;
  show(answer);
  await follow(state.operator);
}

async function cancel() {
  const answer = await attempt(() => cancelComputing(state.operator));
  if (answer) show(answer);
}

/** @param {string} operator whose result is looked at until it is there */
async function follow(operator) {
  looking = operator;
  for (;;) {
    const answer = await attempt(() => getResult(operator));
    if (operator !== state.operator || !answer) return;
    show(answer);
    if (answer.state !== "computing") return;
    await new Promise((resolve) => { setTimeout(resolve, LOOK_AGAIN_MS); });
  }
}

/** Draw the result, perhaps in another language. */
export function drawResult() {
  if (result) show(result);
}

/** @param {import("../types.js").HandResult} now */
function show(now) {
  result = now;
  const words = { none: "digitize.result_none", computing: "digitize.result_computing", done: "digitize.result_done", failed: "digitize.result_failed" }[now.state];
  const computing = now.state === "computing";
  const doing = now.paused ? t("digitize.result_paused") : now.step && t(`measurement.step_${now.step}`);
  setText($("result-state"), [t(words), computing ? doing : now.problem ? say(now.problem).text : now.said.map((each) => say(each).text).join("; ")].filter(Boolean).join(" "));
  $("compute").disabled = computing;
  $("compute-cancel").hidden = $("result-share").hidden = !computing;
  $("result-share").value = now.share;
  $("result-files").replaceChildren(...now.files.map((name) => make("a", {
    class: "button", href: resultFile(state.operator, name), ...name.endsWith(".html") ? { target: "_blank", rel: "noopener" } : { download: "" },
  }, icon(name.endsWith(".html") ? "log" : "download"), make("span", {}, name === "report.html" ? t("measurement.report") : name))));
}
