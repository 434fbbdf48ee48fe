/** Puts the page together. Each part draws itself from what store.js holds; connection.js keeps that up to date. */

import { startAlarms } from "./frame/alarms.js";
import { drawKeys, startKeys } from "./frame/keys.js";
import { loadView, startLoading } from "./frame/loading.js";
import { startLogin } from "./frame/login.js";
import { startPill } from "./frame/pill.js";
import { startRole } from "./frame/role.js";
import { startSettings } from "./frame/settings.js";
import { startSignals } from "./frame/signals.js";
import { startLanguage } from "./i18n/i18n.js";
import { loadedParts, loadPart, partOf } from "./parts/parts.js";
import { connect, startBanner } from "./shared/connection.js";
import { startRouter } from "./shared/router.js";
import { known, update, watch } from "./shared/store.js";

/** The part whose view is shown; null: none is yet. @type {import("./parts/parts.js").Part|null} */
let shown = null;
let connected = false;

/** Draw every part anew, after the language was changed. */
function redraw() {
  update({});
  for (const part of loadedParts()) part.draw?.();
  drawKeys();
}

function leave() {
  shown?.leave?.();
  shown = null;
}

/** @param {import("./shared/router.js").Place} place */
function enter(place) {
  shown = partOf(place.view);
  shown?.enter?.(place);
}

function connectOnce() {
  if (connected || known.view === "jump") return; // a link opens its jump, and not what happens at the hill
  connected = true;
  connect();
}

await startLanguage();
startSettings(redraw);
startBanner();
startPill();
startKeys(() => shown?.keys?.() ?? {});
startRole();
startSignals();
startAlarms();
startLogin(() => location.reload());
startLoading();
startRouter((view) => partOf(view) !== null, (view) => loadView(() => loadPart(view)), enter, leave);
watch(connectOnce);
document.addEventListener("visibilitychange", () => update({ visible: !document.hidden }));
