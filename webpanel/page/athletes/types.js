/**
 * The shapes of answers about all measured jumps, as in rig/api (a test compares them).
 *
 * @typedef {import("../shared/types.js").LastJump} LastJump
 *
 * @typedef {object} AthleteJump
 * @property {string} athlete
 * @property {string} bib
 * @property {string} gate
 * @property {"good"|"warning"|"info"|"error"} level
 * @property {LastJump} jump
 *
 * @typedef {object} Athlete
 * @property {string} name
 * @property {string} bib
 * @property {number} jumps
 * @property {string} first
 * @property {string} last
 *
 * @typedef {object} QuantityDifference Where two groups differ most in a quantity.
 * @property {string} quantity
 * @property {boolean} different
 * @property {number} since_takeoff_s
 * @property {number} difference
 * @property {number} sigma
 * @property {number} p
 * @property {number} needed
 *
 * @typedef {object} Comparison
 * @property {number} first
 * @property {number} second
 * @property {number} left_out
 * @property {number} scatter_jumps
 * @property {string[]} different
 * @property {QuantityDifference[]} quantities
 * @property {boolean} one_place
 */

export {};
