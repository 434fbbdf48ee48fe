/** What the service says, in Norwegian, by code. */

import { adjustment } from "./nb-adjustment.js";
import { analysis } from "./nb-analysis.js";
import { digitizing } from "./nb-digitizing.js";
import { events } from "./nb-events.js";
import { files } from "./nb-files.js";
import { findings } from "./nb-findings.js";
import { refusals } from "./nb-refusals.js";
import { statements } from "./nb-statements.js";
import { targets } from "./nb-targets.js";

/** @type {Record<string, [string, string?]>} text and advice */
export const said = { ...statements, ...findings, ...events, ...analysis, ...refusals, ...digitizing, ...targets, ...files, ...adjustment };
