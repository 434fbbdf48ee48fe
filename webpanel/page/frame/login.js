/** The login: asks for the token when the service wants it, and gets a cookie for it that no script can read. */

import { say } from "../i18n/i18n.js";
import { call, onTokenNeeded } from "../shared/api.js";
import { $, setText } from "../shared/dom.js";
import { known } from "../shared/store.js";

let needed = false;

/** @param {() => void} done called after the login */
export function startLogin(done) {
  onTokenNeeded(show);
  $("login").addEventListener("close", () => { if (needed) show(); }); // without the token the page has nothing to show
  $("login-form").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    void login(done);
  });
}

function show() {
  if (known.view === "jump") return; // who has come by a link has no token; his page says what is wrong
  needed = true;
  if (!$("login").open) $("login").showModal();
}

/** @param {() => void} done */
async function login(done) {
  $("login-submit").disabled = true;
  $("login-wrong").hidden = true;
  try {
    await call("POST", "login", { token: $("login-token").value });
    needed = false;
    $("login").close();
    done();
  } catch (error) {
    const { code, message } = /** @type {import("../shared/api.js").Problem} */ (error);
    setText($("login-wrong"), say({ code, text: message }).text);
    $("login-wrong").hidden = false;
  } finally {
    $("login-token").value = "";
    $("login-submit").disabled = false;
    $("login-token").focus();
  }
}
