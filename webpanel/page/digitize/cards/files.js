/** What was measured as files, to keep or for other programs; reading such files; and how operators agree. */

import { say, t } from "../../i18n/i18n.js";
import { $, icon, make, setText } from "../../shared/dom.js";
import { number } from "../../shared/format.js";
import { attempt, tell } from "../../shared/snacks.js";
import { exportAddress, getRepeatability, importFile } from "../session/server.js";
import { reloadAll } from "../session/session.js";
import { state, watch } from "../session/state.js";
import { nameOf } from "./numbers.js";
import { titleOf } from "./things.js";

/** What is read, by the ending of its name; anything else is taken for measurements.json. @type {Record<string, string>} */
const TYPES = { csv: "text/csv", zip: "application/zip" };
const FILES = ["measurements.json", "network.json", "marks.csv", "dltdv.zip", "argus.zip"];

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
  const type = TYPES[file.name.split(".").at(-1)] ?? "application/json";
  const done = await attempt(async () => { await importFile(state.operator, new Blob([file], { type })); return true; });
  if (!done) return;
  await reloadAll();
  tell("good", t("digitize.imported", { name: file.name }));
}

async function compare() {
  const found = await attempt(() => getRepeatability([state.operator, $("compare-with").value]));
  if (!found) return;
  setText($("compare-says"), found.said.map((each) => say(each).text).join("; "));
  const numbers = (/** @type {number[]} */ values) => values.map((value) => number(value, 2)).join(", ");
  const row = (/** @type {string[]} */ [name, ...cells]) => make("tr", {}, make("th", { scope: "row" }, name), ...cells.map((cell) => make("td", {}, cell)));
  const head = [t("digitize.compare_what"), t("digitize.compare_count"), t("digitize.compare_sigma"), ...found.operators];
  $("compare-table").replaceChildren(
    make("thead", {}, make("tr", {}, ...head.map((words) => make("th", { scope: "col" }, words)))),
    make("tbody", {},
      ...Object.entries(found.things).map(([name, { count, sigma_px, bias_px }]) => row([
        titleOf(name), String(count), `${number(sigma_px, 2)} px`, ...found.operators.map((who) => numbers(bias_px[who] ?? [])),
      ])),
      ...Object.entries(found.figures).map(([name, { count, sigma, bias }]) => row([
        nameOf(name), String(count), number(sigma, 2), ...found.operators.map((who) => numbers(who in bias ? [bias[who]] : [])),
      ]))));
}
