/** What the list is narrowed down to, and its order: the search field and the panel of filters. */

import { t } from "../i18n/i18n.js";
import { $, setText } from "../shared/dom.js";

/** While somebody types, the service is not asked for every letter. */
const PAUSE_MS = 200;
const FIELDS = ["sort", "verdict", "tag", "since", "until"];

/** @param {() => void} changed called when another list is wanted */
export function startFilters(changed) {
  let timer = 0;
  const soon = () => { clearTimeout(timer); timer = setTimeout(changed, PAUSE_MS); };
  $("recordings-search").addEventListener("input", soon);
  $("filters").addEventListener("input", () => { drawFilters(); soon(); });
  $("filters").addEventListener("submit", (/** @type {Event} */ event) => event.preventDefault());
  $("filters-toggle").addEventListener("click", () => { $("filters").hidden = !$("filters").hidden; drawFilters(); });
  $("filters-clear").addEventListener("click", () => { $("filters").reset(); $("recordings-search").value = ""; drawFilters(); changed(); });
}

/** The parameters of the list for the service. */
export function filterQuery() {
  const wanted = new URLSearchParams();
  const search = $("recordings-search").value.trim();
  if (search) wanted.set("search", search);
  for (const name of FIELDS) {
    const { value } = $(`filter-${name}`);
    if (value.trim()) wanted.set(name, name === "since" || name === "until" ? midnight(value, name === "until" ? 1 : 0) : value.trim());
  }
  if ($("filter-favourite").checked) wanted.set("favourite", "true");
  return wanted;
}

/** Whether the list is narrowed down. */
export function filtered() {
  return [...filterQuery().keys()].some((name) => name !== "sort");
}

/** Whether days follow each other in the list, so that it can be parted by them. */
export function sortedByTime() {
  return ["", "oldest"].includes($("filter-sort").value);
}

/** Say on the button how many filters are set. */
export function drawFilters() {
  const count = [...filterQuery().keys()].filter((name) => name !== "search" && name !== "sort").length;
  setText($("filters-words"), count ? t("filters.some", { count }) : t("filters.title"));
  $("filters-toggle").setAttribute("aria-expanded", String(!$("filters").hidden));
  $("filters-toggle").classList.toggle("active", count > 0);
}

/**
 * When a day begins where the browser is.
 *
 * @param {string} date e.g. 2026-11-20
 * @param {number} later days
 */
function midnight(date, later) {
  const [year, month, day] = date.split("-").map(Number);
  return new Date(year, month - 1, day + later).toISOString();
}
