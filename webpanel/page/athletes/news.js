/** Tells when what was measured may have changed: a recording is another one, or the queue has moved. */

import { hear } from "../shared/connection.js";
import { watch, known } from "../shared/store.js";

/** @param {() => void} action */
export function onMeasured(action) {
  let queue = "";
  hear({ recordings: action });
  watch(() => {
    const now = known.status?.measuring;
    const last = known.status?.last_jump;
    const before = queue;
    if (now) queue = `${now.recording} ${now.waiting} ${last?.recording} ${last?.jump} ${last?.live}`;
    if (queue !== before && before) action();
  });
}
