/** The banner that says that the connection is lost, and when it is tried again. */

import { $, setText } from "./dom.js";
import { connectNow } from "./events.js";
import { t } from "./i18n.js";
import { known, watch } from "./store.js";

export function startBanner() {
  $("banner-retry").addEventListener("click", connectNow);
  watch(draw);
  setInterval(draw, 1000);
}

function draw() {
  const lost = !known.connected && known.heard > 0 || known.retryAt > 0;
  $("banner").hidden = !lost;
  if (!lost) return;
  const seconds = Math.max(0, Math.ceil((known.retryAt - Date.now()) / 1000));
  setText($("banner-text"), t("lost.text"));
  setText($("banner-retry"), seconds ? t("lost.retry_in", { seconds }) : t("lost.trying"));
  $("banner-retry").disabled = !known.retryAt;
}
