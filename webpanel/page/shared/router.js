/** Which view is shown: the part of the address after #, e.g. #/recordings/2026-11-21T20-54-50Z. */

import { $ } from "./dom.js";
import { update } from "./store.js";

const VIEWS = ["live", "recordings", "recording", "athlete", "jumps", "log", "doctor", "aim", "rig", "coach", "jump"];

/** Views that one comes to from another, whose place in the navigation they share. @type {Record<string, string>} */
const UNDER = { recording: "recordings", athlete: "recordings", jumps: "recordings", aim: "live" };

/** Views of one of several: which, whose, or of which day stands behind the view's name. */
const BY_ID = ["athlete", "jumps"];

/** Views that show nothing without an id. */
const ONLY_BY_ID = ["recording", "jump"];

/** @typedef {{ view: string, id: string, trash: boolean, key: string, jump: number }} Place `key`: of the link by which an athlete came; `jump`: number of that of a recording */

/** @returns {Place} */
export function place() {
  const [name, id = "", key = ""] = location.hash.replace(/^#\//, "").split("/");
  const found = { view: VIEWS.includes(name) && !ONLY_BY_ID.includes(name) ? name : "live", id: "", trash: false, key: "", jump: 1 };
  if (name === "trash") return { ...found, view: "recordings", trash: true };
  if (name === "recordings" && id) return { ...found, view: "recording", id: decodeURIComponent(id), jump: Number(key) || 1 };
  if (name === "jump" && id) return { ...found, view: "jump", id: decodeURIComponent(id), key };
  return BY_ID.includes(name) ? { ...found, id: decodeURIComponent(id) } : found;
}

let follow = () => {};

/**
 * Go to a view. If it is loaded, it is shown when this returns: the key that is pressed next acts on it.
 *
 * @param {string} path e.g. "recordings"
 */
export function go(path) {
  location.hash = `#/${path}`;
  follow();
}

/**
 * Show the view of the address, now and whenever it changes. One that is not loaded yet is shown when it is.
 *
 * @param {(view: string) => boolean} loaded
 * @param {(view: string) => Promise<boolean>} load loads what is behind a view, and says whether it is there
 * @param {(place: Place) => void} entered
 * @param {() => void} leaving called while the view before is still shown and scrolled as it was
 */
export function startRouter(loaded, load, entered, leaving) {
  history.scrollRestoration = "manual"; // a view that keeps its place scrolls by itself
  let address = "";
  const show = () => {
    address = location.hash;
    const now = place();
    const there = loaded(now.view);
    for (const name of VIEWS) $(name).hidden = !there || name !== now.view;
    $("loading").hidden = there;
    document.body.dataset.view = now.view;
    const tab = UNDER[now.view] ?? now.view;
    for (const link of document.querySelectorAll(".nav a")) {
      if (link.getAttribute("href") === `#/${tab}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    scrollTo(0, 0);
    update({ view: now.view });
    if (there) entered(now);
    else void arrive(now.view);
  };
  const arrive = async (/** @type {string} */ view) => {
    if (await load(view) && place().view === view && !$("loading").hidden) show();
  };
  follow = () => {
    if (location.hash === address) return; // the event comes after go() has shown the view
    leaving();
    show();
    $("main").focus({ preventScroll: true });
  };
  addEventListener("hashchange", follow);
  show();
}
