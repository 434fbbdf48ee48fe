/** An athlete's page: each figure of all his measured jumps over the days, two spans compared, the jumps in a table. */

import { t } from "../i18n/i18n.js";
import { call } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { number } from "../shared/format.js";
import { place } from "../shared/router.js";
import { attempt } from "../shared/snacks.js";
import { drawChart } from "./chart.js";
import { csvOf, keep } from "./csv.js";
import { dayOf, FIGURES, figureOf } from "./figures.js";
import { makeTable, OF_ATHLETE } from "./jumptable.js";
import { onMeasured } from "./news.js";
import { drawSpans, offerSpans, startSpans } from "./spans.js";

/** @typedef {import("./types.js").AthleteJump} AthleteJump */

/** So many days are drawn, the newest ones, until somebody wants all. */
const DAYS = 12;

/** @type {(jumps: AthleteJump[]) => void} */
let fill = () => {};
/** All of his jumps, newest first; null: they have not come yet. @type {AthleteJump[]|null} */
let jumps = null;
let whole = false;
let asked = 0;

export function startAthlete() {
  fill = makeTable($("athlete-table"), OF_ATHLETE, true);
  startSpans();
  $("athlete-whole").addEventListener("click", () => { whole = !whole; drawAthlete(); });
  $("athlete-csv").addEventListener("click", () => keep(csvOf([...jumps ?? []].reverse()), `svev-${place().id.replace(/[^\p{L}\p{N}]+/gu, "-")}.csv`));
  onMeasured(() => { if (place().view === "athlete") void load(); });
}

/** Show the athlete of the address. */
export async function enterAthlete() {
  jumps = null;
  whole = false;
  drawAthlete();
  await load();
}

async function load() {
  const own = ++asked;
  const { id } = place();
  const found = await attempt(() => call("GET", `jumps?${new URLSearchParams({ athlete: id })}`));
  if (!found || own !== asked || place().id !== id) return;
  jumps = id.trim() ? found : []; // no name asks for everybody's
  drawAthlete();
}

/** Draw the page. */
export function drawAthlete() {
  const found = jumps ?? [];
  const days = [...new Set(found.map(({ jump }) => dayOf(jump.time)))];
  setText($("athlete-name"), found[0]?.athlete || place().id);
  setText($("athlete-count"), jumps ? t(days.length === 1 ? "athletes.count_day" : "athletes.count_days", { count: found.length, days: days.length }) : "");
  $("athlete-empty").hidden = jumps === null || found.length > 0;
  $("athlete-known").hidden = !found.length;
  if (!found.length) return;
  $("athlete-whole").hidden = days.length <= DAYS;
  $("athlete-whole").setAttribute("aria-pressed", String(whole));
  setText($("athlete-whole"), t("athletes.all_days", { days: days.length }));
  const shown = new Set(whole ? days : days.slice(0, DAYS));
  const drawn = found.filter(({ jump }) => shown.has(dayOf(jump.time))).reverse();
  $("athlete-charts").replaceChildren(...FIGURES.map((figure) => makeCard(figure, drawn)));
  offerSpans(days);
  drawSpans();
  fill(found);
}

/**
 * @param {{ name: import("./figures.js").Name, unit: string }} figure
 * @param {AthleteJump[]} drawn oldest first
 */
function makeCard({ name, unit }, drawn) {
  const title = t(`measured.${name}`);
  const dots = drawn.flatMap((each) => {
    const found = figureOf(each, name);
    return found ? [{ day: dayOf(each.jump.time), value: found.value, sigma: found.sigma, good: each.level === "good" }] : [];
  });
  const good = dots.filter((dot) => dot.good);
  const mean = good.reduce((sum, { value }) => sum + value, 0) / good.length;
  const words = good.length ? t("athletes.chart", { title, count: good.length, mean: number(mean, 2), unit }) : title;
  return make("section", { class: "card" }, make("h2", {}, `${title} (${unit})`), dots.length ? drawChart(dots, words) : make("p", { class: "hint" }, t("athletes.never")));
}
