/** The rig file in use. */

import { draw, enterRig, startRig } from "../system/rig.js";

export { draw, enterRig as enter, startRig as start };
