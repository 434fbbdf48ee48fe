/** The token, asked for once when the service wants it. It is exchanged for a cookie that no script can read. */

import { call, onTokenNeeded } from "./api.js";
import { $, setText } from "./dom.js";
import { say } from "./i18n.js";

let needed = false;

/** @param {() => void} done called when the service lets us in */
export function startLogin(done) {
  onTokenNeeded(show);
  $("login").addEventListener("close", () => { if (needed) show(); }); // there is nothing behind it
  $("login-form").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    void login(done);
  });
}

function show() {
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
    const { code, message } = /** @type {import("./api.js").Problem} */ (error);
    setText($("login-wrong"), say({ code, text: message }).text);
    $("login-wrong").hidden = false;
  } finally {
    $("login-token").value = "";
    $("login-submit").disabled = false;
    $("login-token").focus();
  }
}
