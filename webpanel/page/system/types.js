/**
 * The shapes of what the REST API says of single cameras, as in rig/api (a test compares them).
 *
 * @typedef {object} CameraAids
 * @property {string} camera
 * @property {number} pulse
 * @property {"ok"|"lost"|"missed"|"damaged"|"absent"} status
 * @property {number|null} focus
 * @property {number|null} mean
 * @property {number|null} clipped
 * @property {number|null} black
 * @property {number[]} histogram
 *
 * @typedef {object} Region
 * @property {number} x
 * @property {number} y
 * @property {number} width
 * @property {number} height
 *
 * @typedef {object} RegionLimits
 * @property {number} width
 * @property {number} height
 * @property {number} step_x
 * @property {number} step_y
 * @property {number} step_width
 * @property {number} step_height
 * @property {number} least_width
 * @property {number} least_height
 *
 * @typedef {object} CameraLight
 * @property {string} camera
 * @property {number} exposure_us
 * @property {number} gain_db
 * @property {Region} region
 * @property {RegionLimits|null} limits
 * @property {import("../shared/types.js").Statement|null} calibration
 * @property {boolean} saved
 *
 * @typedef {object} BallPlace
 * @property {string} name
 * @property {number|null} x
 * @property {number|null} y
 * @property {[number, number]|null} sigma
 * @property {boolean} inside
 * @property {boolean|null} seen
 *
 * @typedef {object} CameraBalls
 * @property {string} camera
 * @property {number} width
 * @property {number} height
 * @property {"calibration"|"orientation"|"survey"|"plan"|null} source
 * @property {string|null} file
 * @property {string|null} oriented
 * @property {string|null} recording
 * @property {BallPlace[]} balls
 * @property {import("../shared/types.js").Statement|null} statement
 *
 * @typedef {object} SeenTarget
 * @property {string} camera
 * @property {number} width
 * @property {number} height
 * @property {[number, number][]} corners
 * @property {number} pictures
 * @property {number[][]} cells
 * @property {import("../shared/types.js").Statement[]} missing
 *
 * @typedef {object} CalibratedLens
 * @property {string} camera
 * @property {boolean} good
 * @property {import("../shared/types.js").Statement} verdict
 * @property {import("../shared/types.js").Statement[]} advice
 * @property {[number, number, number, number][]} residuals
 *
 * @typedef {object} Calibrating
 * @property {"off"|"looking"|"held"|"computing"|"done"|"failed"} state
 * @property {boolean} still
 * @property {boolean} full
 * @property {string|null} folder
 * @property {{columns: number, rows: number, square_mm: number, target_mm: number}|null} printed
 * @property {number} taken
 * @property {SeenTarget[]} cameras
 * @property {import("../shared/types.js").Statement|null} problem
 * @property {CalibratedLens[]} lenses
 * @property {boolean} saved
 *
 * @typedef {object} RigView
 * @property {string} name
 * @property {string} toml
 * @property {Record<string, any>} settings
 */

export {};
