/** What was measured as files, to keep or for other programs; reading such files; and how operators agree. */

import { t } from "../i18n/i18n.js";
import { $, icon, make, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { attempt, tell } from "../shared/snacks.js";
import { exportAddress, getRepeatability, importFile } from "./server.js";
import { reloadAll } from "./session.js";
import { state, watch } from "./state.js";
import { titleOf } from "./things.js";

const FILES = ["measurements.json", "marks.csv", "dltdv.zip", "argus.zip"];

export function startFiles() {
  $("import-choose").addEventListener("click", () => $("import-file").click());
  $("import-file").addEventListener("change", () => void take());
  $("compare").addEventListener("click", () => void compare());
  watch(draw);
}

/** What is shown; it is made anew only when that changes. */
let shown = "";

function draw() {
  const others = (state.opening?.operators ?? []).filter((name) => name !== state.operator);
  const now = JSON.stringify([state.operator, others]);
  if (now === shown) return;
  shown = now;
  $("exports").replaceChildren(...FILES.map((name) => make("a", { class: "button", href: exportAddress(state.operator, name), download: "" }, icon("download"), make("span", {}, name))));
  $("compare-with").replaceChildren(...others.map((name) => new Option(name)));
  $("comparing").hidden = !others.length;
}

async function take() {
  const file = $("import-file").files[0];
  $("import-file").value = "";
  if (!file) return;
  const type = file.name.endsWith(".csv") ? "text/csv" : "application/json";
  const done = await attempt(async () => { await importFile(state.operator, new Blob([file], { type })); return true; });
  if (!done) return;
  await reloadAll();
  tell("good", t("digitize.imported", { name: file.name }));
}

async function compare() {
  const found = await attempt(() => getRepeatability([state.operator, $("compare-with").value]));
  if (!found) return;
  setText($("compare-says"), found.message);
  const row = (/** @type {string} */ name, /** @type {import("./types.js").Estimate} */ { value, sigma }, /** @type {string} */ unit, count = "") =>
    make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, `${number(value, 2)} ${unit}`), make("td", {}, `${number(sigma, 2)} ${unit}`), make("td", {}, count));
  const head = ["digitize.compare_what", "digitize.compare_bias", "digitize.compare_sigma", "digitize.compare_count"].map((words) => make("th", { scope: "col" }, t(words)));
  $("compare-table").replaceChildren(make("thead", {}, make("tr", {}, ...head)), make("tbody", {},
    ...Object.entries(found.points).map(([name, value]) => row(titleOf(name), value, "px", String(found.count[name] ?? ""))),
    ...Object.entries(found.angles).map(([name, value]) => row(name, value, "°"))));
}
