/** The table of a day's measured jumps: sorted, filtered by athlete, taken away as CSV. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { go, place } from "../shared/router.js";
import { attempt } from "../shared/snacks.js";
import { csvOf, keep } from "./csv.js";
import { dayOf, folded, spanOf } from "./figures.js";
import { makeTable, OF_SESSION } from "./jumptable.js";
import { onMeasured } from "./news.js";

/** @typedef {import("./types.js").AthleteJump} AthleteJump */

/** @type {(jumps: AthleteJump[]) => void} */
let fill = () => {};
/** The jumps of the day; null: they have not come yet. @type {AthleteJump[]|null} */
let jumps = null;
/** The day shown, e.g. 2026-02-14; "": there is none. */
let shown = "";
let asked = 0;

export function startDay() {
  fill = makeTable($("day-table"), OF_SESSION, false);
  $("day-date").addEventListener("change", () => { if ($("day-date").value) go(`jumps/${$("day-date").value}`); });
  $("day-athlete").addEventListener("change", drawDay);
  $("day-csv").addEventListener("click", () => keep(csvOf(chosen()), `svev-${shown}.csv`));
  onMeasured(() => { if (place().view === "jumps") void load(); });
}

/** Show the day of the address, or the latest one with measured jumps. */
export async function enterDay() {
  jumps = null;
  shown = "";
  $("day-athlete").replaceChildren();
  drawDay();
  await load();
}

async function load() {
  const own = ++asked;
  const { id } = place();
  const found = await attempt(async () => {
    const date = /^\d{4}-\d\d-\d\d$/.test(id) ? id : await latestDay();
    return { date, jumps: date ? await call("GET", `jumps?${new URLSearchParams(spanOf(date))}`) : [] };
  });
  if (!found || own !== asked || place().view !== "jumps") return;
  [shown, jumps] = [found.date, found.jumps];
  drawDay();
}

async function latestDay() {
  /** @type {AthleteJump[]} */
  const [latest] = await call("GET", "jumps?limit=1");
  return latest ? dayOf(latest.jump.time) : "";
}

/** The jumps of the athlete who is chosen, in the order of the day. */
function chosen() {
  const name = $("day-athlete").value;
  return (jumps ?? []).filter(({ athlete }) => !name || folded(athlete) === name).reverse();
}

/** Draw the table. */
export function drawDay() {
  const before = $("day-athlete").value;
  const names = new Map((jumps ?? []).filter(({ athlete }) => folded(athlete)).map(({ athlete }) => [folded(athlete), athlete]));
  $("day-athlete").replaceChildren(
    make("option", { value: "" }, t("athletes.everybody")),
    ...[...names].sort(([one], [two]) => one.localeCompare(two)).map(([value, name]) => make("option", { value }, name)));
  $("day-athlete").value = names.has(before) ? before : "";
  if (shown) $("day-date").value = shown;
  const rows = chosen();
  $("day-empty").hidden = jumps === null || rows.length > 0;
  $("day-box").hidden = !rows.length;
  $("day-csv").disabled = !rows.length;
  setText($("day-count"), rows.length ? t("athletes.count", { count: rows.length }) : "");
  fill(rows);
}
