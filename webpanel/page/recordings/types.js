/**
 * The shapes of answers about recordings that no other view reads, as in rig/api (a test compares them).
 *
 * @typedef {import("../shared/types.js").LastJump} LastJump
 * @typedef {import("../shared/types.js").MeasuringQueue} MeasuringQueue
 * @typedef {import("../shared/types.js").Statement} Statement
 *
 * @typedef {object} Measurement What is known of the jumps of a recording.
 * @property {string} recording
 * @property {MeasuringQueue["state"]} state
 * @property {boolean} paused
 * @property {MeasuringQueue["step"]} step
 * @property {number} share
 * @property {number} before
 * @property {Statement|null} problem
 * @property {boolean} again
 * @property {Statement|null} refused
 * @property {StepState[]} steps
 * @property {string|null} measured
 * @property {string} version
 * @property {object[]|null} jumps
 * @property {LastJump[]} figures
 * @property {boolean} live
 * @property {string[]} files
 * @property {boolean} renaming
 *
 * @typedef {object} StepState How far one of the things is that are done with a log after its end.
 * @property {"measure"|"video"|"copy"} step
 * @property {MeasuringQueue["state"]} state
 * @property {Statement|null} problem
 */

export {};
