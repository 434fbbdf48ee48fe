/** What the list is narrowed down to, and its order: the search field with its conditions, and the panel of filters. */

import { t } from "../i18n/i18n.js";
import { $, make, setText } from "../shared/dom.js";

/** While somebody types, the service is not asked for every letter. */
const PAUSE_MS = 200;
/** A condition in the search field, as the service understands it: `alpha > 48`, `bib:17`, `note:"new boots"`. */
const CONDITION = /[\p{L}][\w-]*(?:\s*(?:>=|<=|>|<)\s*|[:=])(?:"[^"]*"|[^\s">]\S*)/gu;
const FIELDS = ["sort", "verdict", "tag", "since", "until"];

/** @param {() => void} changed called when another list is wanted */
export function startFilters(changed) {
  let timer = 0;
  const soon = () => { clearTimeout(timer); timer = setTimeout(changed, PAUSE_MS); };
  const search = $("recordings-search");
  const rewrite = (/** @type {string} */ text) => { search.value = text.trim(); drawFilters(); changed(); };
  search.addEventListener("input", () => { drawFilters(); soon(); });
  $("recordings-chips").addEventListener("click", (/** @type {Event} */ event) => {
    const chip = /** @type {HTMLElement} */ (event.target).closest("button");
    if (chip) rewrite(search.value.replace(chip.dataset.condition, " ").replace(/\s+/g, " "));
  });
  $("filters").addEventListener("input", () => { drawFilters(); soon(); });
  $("filters").addEventListener("submit", (/** @type {Event} */ event) => {
    event.preventDefault();
    const bound = $("figure-bound").value;
    if (!bound) return;
    $("figure-bound").value = "";
    rewrite(`${search.value} ${$("figure-name").value} ${$("figure-sign").value} ${bound}`);
  });
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

/** Say on the button how many filters are set, and show the conditions of the search field, each to be taken away. */
export function drawFilters() {
  const conditions = $("recordings-search").value.match(CONDITION) ?? [];
  $("recordings-chips").hidden = !conditions.length;
  $("recordings-chips").replaceChildren(...conditions.map((/** @type {string} */ condition) =>
    make("button", { type: "button", "data-condition": condition, "aria-label": t("filters.without", { condition }) }, `${condition}  ×`)));
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
