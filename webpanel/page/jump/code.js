/** The QR code of a jump: on the coach's screen, and on the jump's page when somebody asks for it. */

import { say, t } from "../i18n/i18n.js";
import { call, Problem, recordingPath } from "../shared/api.js";
import { $, make, setText } from "../shared/dom.js";
import { day, timeOfMinute } from "../shared/format.js";
import { attempt, tell } from "../shared/snacks.js";

/**
 * Show the code of a recording in an image, and say until when it opens the jump.
 *
 * @param {string} id
 * @param {HTMLImageElement} image hidden if there is no code
 * @param {HTMLElement} words
 * @param {() => boolean} wanted whether it is still to be shown when it comes
 * @returns {Promise<boolean>} whether the service has answered
 */
export async function showCode(id, image, words, wanted) {
  try {
    const { code, ends } = await call("GET", recordingPath(id, "/link"));
    if (!wanted()) return true;
    putImage(image, code);
    image.alt = t("share.alt");
    setText(words, t("share.until", { day: day(ends), time: timeOfMinute(ends) }));
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (!wanted()) return true;
    if (error.status === 0) return false; // a code of this jump that is there is still good
    clearCode(image, words);
    setText(words, say(error.said).text);
  }
  return true;
}

/**
 * @param {HTMLImageElement} image
 * @param {HTMLElement} words
 */
export function clearCode(image, words) {
  if (image.src) URL.revokeObjectURL(image.src);
  image.removeAttribute("src");
  image.hidden = true;
  setText(words, "");
}

/**
 * @param {HTMLImageElement} image
 * @param {string} svg
 */
function putImage(image, svg) {
  if (image.src) URL.revokeObjectURL(image.src);
  image.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  image.hidden = false;
}

/** Id of the recording whose page is shown. */
let page = "";

export function startShare() {
  $("share-show").addEventListener("click", () => void toggle());
}

/**
 * The page of a recording is shown, or left (""): its code is not, until somebody asks for it.
 *
 * @param {string} id
 */
export function enterShare(id) {
  page = id;
  clearCode($("share-code"), $("share-words"));
  draw();
  $("share-open").hidden = true;
  if (id) void attempt(drawLinks);
}

/** Draw the words anew, in another language. */
export function drawShare() {
  if (page) enterShare(page);
}

async function toggle() {
  const id = page;
  if (!$("share-code").hidden) return enterShare(id);
  await showCode(id, $("share-code"), $("share-words"), () => page === id);
  draw();
  await attempt(drawLinks);
}

/** Draw the links that open the jump, each with a button that takes it back. */
async function drawLinks() {
  const id = page;
  /** @type {{ number: number, made: string, ends: string }[]} */
  const links = await call("GET", recordingPath(id, "/links"));
  if (page !== id) return;
  $("share-open").hidden = !links.length;
  $("share-links").replaceChildren(...links.map(({ number, made, ends }) => make("li", {},
    make("span", {}, t("share.from", { made: `${day(made)}, ${timeOfMinute(made)}`, day: day(ends), time: timeOfMinute(ends) })),
    make("button", { type: "button", "data-needs": "operate", onclick: () => void attempt(() => takeBack(id, number)) }, t("share.back")))));
}

/**
 * @param {string} id of the recording
 * @param {number} number of the link
 */
async function takeBack(id, number) {
  try {
    await call("DELETE", recordingPath(id, `/links/${number}`));
    tell("good", t("share.taken"));
  } finally {
    if (page === id) enterShare(id); // the code in sight may be the one that opens nothing any more
  }
}

function draw() {
  const open = !$("share-code").hidden;
  setText($("share-show"), t(open ? "share.hide" : "share.show"));
  $("share-show").setAttribute("aria-expanded", String(open));
}
