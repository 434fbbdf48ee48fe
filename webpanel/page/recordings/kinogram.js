/** The kinogram of the recording shown: its pictures, large by a tap, and sent by another one. */

import { languageInUse, t } from "../i18n/i18n.js";
import { asProblem, partOf, Problem } from "../shared/api.js";
import { $, icon, make } from "../shared/dom.js";
import { who } from "../shared/format.js";
import { filesOf } from "../shared/resultfiles.js";
import { attempt } from "../shared/snacks.js";
import { jumpShown } from "../viewing/jumps.js";

/** @typedef {import("../shared/types.js").Recording} Recording */
/** @typedef {import("./types.js").Measurement} Measurement */

/** Files of the kinogram, which stand on its card and nowhere else. */
export const KINOGRAM = /^kinogram/;
const PICTURE = /^kinogram(?:-\d+)?\.jpg$/;

/** What is drawn, or being loaded: an answer to anything else is old. */
let wanted = "";
/** Addresses of the pictures in memory. @type {string[]} */
let addresses = [];

export function startKinogram() {
  $("kinogram-large").addEventListener("click", () => $("kinogram-large").close());
}

/**
 * Show the kinogram of a recording.
 *
 * @param {Recording|null} recording null: none is shown
 * @param {Measurement|null} measured what is known of it
 */
export function showKinogram(recording, measured) {
  const place = (measured?.figures ?? []).findIndex(({ jump }) => jump === jumpShown());
  const names = filesOf(measured?.files ?? [], Math.max(0, place) + 1).filter((name) => PICTURE.test(name));
  const { athlete = "", bib = "" } = recording?.session ?? {};
  const now = recording && names.length ? JSON.stringify([languageInUse(), recording.id, measured?.measured, names, athlete, bib]) : "";
  if (now === wanted) return;
  wanted = now;
  if (recording && now) void attempt(() => load(recording, names));
  else clear();
}

function clear() {
  $("kinogram").hidden = true;
  $("kinogram-jumps").replaceChildren();
  if ($("kinogram-large").open) $("kinogram-large").close();
  addresses.forEach((address) => URL.revokeObjectURL(address));
  addresses = [];
}

/**
 * Load the pictures, then draw. They are kept in memory: a page may send only what it has at hand when the button is tapped.
 *
 * @param {Recording} recording
 * @param {string[]} names
 */
async function load(recording, names) {
  const own = wanted;
  try {
    const pictures = await Promise.all(names.map((name) => fetchPicture(recording.id, name)));
    if (own === wanted) draw(recording, names, pictures);
  } catch (error) {
    if (own !== wanted) return;
    wanted = "";
    clear();
    if (!(error instanceof Problem && error.status === 409)) throw error; // they get a corrected name; then they are listed again
  }
}

/**
 * @param {string} id
 * @param {string} name
 * @returns {Promise<Blob>}
 */
async function fetchPicture(id, name) {
  const answer = await fetch(fileOf(id, name), { cache: "no-cache" });
  if (!answer.ok) throw await asProblem(answer);
  return answer.blob();
}

/**
 * @param {string} id
 * @param {string} name
 */
function fileOf(id, name) {
  return partOf(id, `measurement/files/${encodeURIComponent(name)}`);
}

/**
 * @param {Recording} recording
 * @param {string[]} names
 * @param {Blob[]} pictures
 */
function draw(recording, names, pictures) {
  clear();
  $("kinogram-jumps").replaceChildren(...pictures.map((picture, index) => makeJump(recording, names[index], picture)));
  $("kinogram").hidden = false;
}

/**
 * A picture with its buttons.
 *
 * @param {Recording} recording
 * @param {string} name
 * @param {Blob} picture
 */
function makeJump({ id, session }, name, picture) {
  const address = URL.createObjectURL(picture);
  addresses.push(address);
  const alt = t("kinogram.alt", { who: who(session, t("recordings.nobody")) });
  const open = () => { $("kinogram-picture").src = address; $("kinogram-picture").alt = alt; $("kinogram-large").showModal(); };
  return make("div", { class: "kinogram-jump" },
    make("button", { type: "button", class: "plain kinogram-open", title: t("kinogram.large"), onclick: open }, make("img", { src: address, alt })),
    make("div", { class: "buttons" },
      makeSend(address, new File([picture], `${id}-${name}`, { type: "image/jpeg" })),
      make("a", { class: "button", href: fileOf(id, "kinogram.html"), target: "_blank", rel: "noopener" }, icon("log"), make("span", {}, t("kinogram.page")))));
}

/**
 * A button that hands the picture to the phone's own ways of sending; where the browser has none, it saves it.
 *
 * @param {string} address
 * @param {File} file
 */
function makeSend(address, file) {
  const what = { files: [file] };
  if (!navigator.canShare?.(what)) return make("a", { class: "button big primary", href: address, download: file.name }, icon("download"), make("span", {}, t("kinogram.save")));
  const send = () => navigator.share(what).catch((error) => { if (error.name !== "AbortError") throw error; }); // whoever closes the list sends nothing
  return make("button", { type: "button", class: "big primary", onclick: () => void send() }, icon("next"), make("span", {}, t("kinogram.send")));
}
