/** The live log. */

import { startLog } from "../system/log.js";

export { startLog as start };
