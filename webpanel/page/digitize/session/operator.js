/** Who measures: asked once, kept by the browser. Each operator has marks of his own. */

import { t } from "../../i18n/i18n.js";
import { $, setText } from "../../shared/dom.js";
import { load, save } from "../../shared/store.js";
import { openSession } from "./session.js";
import { state, watch } from "./state.js";

/** As the service takes them: letters, figures, spaces, dots and hyphens. */
const NAME = "[\\p{L}\\p{N}_][\\p{L}\\p{N}_ .\\-]{0,39}";

/** Begin with the operator known, or ask for the name. */
export function startOperator() {
  $("operator-name").pattern = NAME;
  $("operator").addEventListener("click", ask);
  $("operator-form").addEventListener("submit", () => {
    const name = $("operator-name").value.trim();
    save("digitize.operator", name);
    if (name !== state.operator) void openSession(name);
  });
  $("operator-dialog").addEventListener("cancel", (/** @type {Event} */ event) => { if (!state.operator) event.preventDefault(); });
  watch(() => {
    const name = state.operator || t("digitize.operator_none");
    setText($("operator-shown"), name);
    $("operator").setAttribute("aria-label", t("digitize.operator_change", { name }));
  });
  const known = load("digitize.operator", "");
  if (known) void openSession(known);
  else ask();
}

function ask() {
  $("operator-name").value = state.operator;
  $("operator-known").replaceChildren(...(state.opening?.operators ?? []).map((name) => new Option(name)));
  $("operator-dialog").showModal();
}
