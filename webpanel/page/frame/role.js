/**
 * What this browser may do: hides and locks what its role does not allow, and lets it log out.
 *
 * An element with data-needs="operate" or "administer" is hidden from lower roles (frame.css). One with data-locks stays
 * readable, and cannot be used by who may only watch.
 */

import { t } from "../i18n/i18n.js";
import { call, Problem } from "../shared/api.js";
import { renew } from "../shared/connection.js";
import { $, setText } from "../shared/dom.js";
import { attempt } from "../shared/snacks.js";
import { known, update, watch } from "../shared/store.js";

/** @type {Record<string, string>} */
const WORDS = { watch: "role.watch", operate: "role.operate", administer: "role.administer" };

let asking = false;
let loggedIn = false;

/** Show the role; ask for it as soon as the service is there. */
export function startRole() {
  $("logout").addEventListener("click", () => void logOut());
  watch(() => {
    draw();
    if (known.connected && !known.role && !asking) void takeRole();
  });
}

async function takeRole() {
  asking = true;
  try {
    const { role, logged_in } = await call("GET", "access");
    loggedIn = logged_in;
    update({ role });
  } catch (error) {
    if (!(error instanceof Problem)) throw error; // the banner or the login says it; the next status asks again
  } finally {
    asking = false;
  }
}

function draw() {
  document.body.dataset.role = known.role;
  for (const element of document.querySelectorAll("[data-locks]")) element.toggleAttribute("inert", known.role === "watch");
  $("own-access").hidden = !loggedIn;
  setText($("role-words"), known.role ? t(WORDS[known.role]) : "");
}

async function logOut() {
  await attempt(async () => {
    await call("POST", "logout");
    renew();
    location.reload();
  });
}
