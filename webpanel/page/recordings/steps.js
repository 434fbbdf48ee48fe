/** The steps that are taken with a log after its end, each with its state: measured, video, copy. */

import { say, t } from "../i18n/i18n.js";
import { make, makeMark } from "../shared/dom.js";

/** @typedef {import("./types.js").StepState} StepState */

/** What the mark of a state says; an icon of the same name. */
const LEVELS = { none: "info", waiting: "info", measuring: "info", done: "good", failed: "warning" };

/**
 * The steps, if there are any beside the measuring, which is shown by itself.
 *
 * @param {StepState[]} steps
 * @returns {HTMLElement[]} list items
 */
export function makeSteps(steps) {
  if (steps.every(({ step }) => step === "measure")) return [];
  return steps.map(({ step, state, problem }) => {
    const level = LEVELS[state];
    const why = step !== "measure" && problem ? say(problem) : null;
    return make("li", {}, makeMark(level, level, `${t(`measurement.after_${step}`)}: ${t(`measurement.state_${state}`)}`),
      why ? make("p", { class: "advice" }, [why.text, why.advice].filter(Boolean).join(" ")) : null);
  });
}
