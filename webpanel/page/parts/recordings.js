/** The list of recordings, and the trash. */

import { draw, enterRecordings, leaveRecordings, startRecordings } from "../recordings/recordings.js";

export { draw, enterRecordings as enter, leaveRecordings as leave, startRecordings as start };
