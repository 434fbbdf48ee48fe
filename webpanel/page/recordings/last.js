/** The recording that ended last, in the live view. */

import { call, recordingPath } from "../shared/api.js";
import { hear } from "../shared/connection.js";
import { $ } from "../shared/dom.js";
import { known, watch } from "../shared/store.js";
import { watchCatalogue } from "./catalogue.js";
import { makeLink } from "./row.js";

let last = "";

export function startLast() {
  const again = () => void load(true);
  hear({ recordings: again });
  watchCatalogue(again);
  watch(() => void load(false));
}

/** @param {boolean} again also if it is shown already: somebody may have changed it */
async function load(again) {
  const id = known.status?.last_recording ?? "";
  if (!known.connected || (id === last && !again)) return;
  last = id;
  try {
    const recording = id ? await call("GET", recordingPath(id)) : null;
    $("last").hidden = !recording || recording.deleted;
    if (recording) $("last-recording").replaceChildren(makeLink(recording));
  } catch {
    $("last").hidden = true; // it was deleted for good meanwhile, or the connection is lost, which the banner says
  }
}
