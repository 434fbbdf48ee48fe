/** The shared worker in which all tabs of a browser have one connection to the service. */

import { makeHub } from "./hub.js";

const join = makeHub(true);

/** @type {any} */ (self).onconnect = (/** @type {MessageEvent} */ { ports: [port] }) => join(port);
