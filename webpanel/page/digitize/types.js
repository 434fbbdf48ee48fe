/**
 * The shapes of the answers about measuring by hand, as in rig/api/digitizing.py (a test compares them).
 *
 * @typedef {import("../shared/types.js").Phrase} Phrase
 * @typedef {[number, number]} Place px; (0, 0) is the centre of the top-left pixel
 * @typedef {"measured"|"guess"|"hidden"|"not visible"} MarkState
 * @typedef {"hand"|"refined"|"tracked"|"automatic"} MarkSource
 *
 * @typedef {object} Estimate
 * @property {number} value
 * @property {number} sigma
 *
 * @typedef {object} Mark
 * @property {number} pulse
 * @property {string} camera
 * @property {string} thing
 * @property {number|null} vertex
 * @property {MarkState} state
 * @property {Place|null} xy
 * @property {[number, number]|null} sigma
 * @property {MarkSource} source
 *
 * @typedef {object} LineMarks
 * @property {MarkState} state
 * @property {Mark[]} vertices
 *
 * @typedef {object} AutomaticPoint
 * @property {Place} xy
 * @property {[number, number]} sigma
 * @typedef {object} AutomaticLine
 * @property {Place[]} xy
 * @property {[Place, Place]} vertices
 * @property {number} across
 *
 * @typedef {object} SpacePoint
 * @property {[number, number, number]|null} X
 * @property {[number, number, number]|null} sigma
 * @property {string} status
 * @property {string[]} rays
 * @property {Record<string, Place>} residuals
 * @property {Record<string, number>} w
 * @property {Phrase|null} finding
 *
 * @typedef {object} SideCheck
 * @property {boolean|null} ok
 * @property {Phrase} said
 * @typedef {object} SpaceLine
 * @property {Estimate|null} slope
 * @property {Estimate|null} heading
 * @property {string} status
 * @property {Record<string, number>} w
 * @property {Phrase|null} finding
 * @property {SideCheck|null} sides
 *
 * @typedef {object} PredictedPoint
 * @property {Place} xy
 * @property {[number, number, number]} ellipse
 * @property {"rays"|"time"} source
 *
 * @typedef {object} PulseView
 * @property {number} revision
 * @property {number} pulse
 * @property {Record<string, Record<string, Mark|LineMarks>>} marks
 * @property {Record<string, Record<string, AutomaticPoint|AutomaticLine>>} automatic
 * @property {Record<string, SpacePoint>} space
 * @property {Record<string, SpaceLine>} lines
 * @property {Record<string, Record<string, PredictedPoint>>} predicted
 * @property {Record<string, Record<string, Place[]>>} previous
 * @property {Record<string, Estimate>} figures
 *
 * @typedef {object} Touched
 * @property {number} pulse
 * @property {string} camera
 * @property {string} thing
 * @typedef {object} Changed
 * @property {number} revision
 * @property {number} undo
 * @property {number} redo
 * @property {Touched|null} touched
 * @property {PulseView|null} view
 * @typedef {object} Changes
 * @property {number} revision
 * @property {Touched[]} touched
 *
 * @typedef {object} Worst
 * @property {number} pulse
 * @property {string} camera
 * @property {string} thing
 * @property {number} w
 * @typedef {object} SessionView
 * @property {number} revision
 * @property {number} undo
 * @property {number} redo
 * @property {Record<string, Record<string, Record<string, string>>>} coverage
 * @property {Worst[]} worst
 * @property {Record<string, Record<string, Mark>>} balls
 *
 * @typedef {object} Thing
 * @property {string} name
 * @property {"point"|"line"|"ball"} kind
 * @property {string} title
 * @property {string} group
 * @property {string|null} colour
 *
 * @typedef {object} OrientationState
 * @property {"none"|"working"|"done"|"failed"} state
 * @property {Phrase|null} message
 * @property {Phrase[]} findings
 *
 * @typedef {object} ViewedCamera
 * @property {string} name
 * @property {[number, number]} size
 * @property {boolean} oriented
 * @typedef {object} JumpSpan
 * @property {number} first
 * @property {number} last
 * @property {number|null} takeoff
 *
 * @typedef {object} Opening
 * @property {string} recording
 * @property {number} rate_hz
 * @property {ViewedCamera[]} cameras
 * @property {number[]} pulses
 * @property {Record<string, string>} status
 * @property {Thing[]} things
 * @property {OrientationState} orientation
 * @property {string[]} operators
 * @property {JumpSpan|null} jump
 *
 * @typedef {object} Curve
 * @property {Place[]} line
 * @property {Place[]} low
 * @property {Place[]} high
 * @typedef {object} Geometry
 * @property {Record<string, Curve>} curves
 * @property {SpacePoint|null} space
 * @property {Record<string, PredictedPoint>} predicted
 *
 * @typedef {object} Refined
 * @property {Place} xy
 * @property {Place|null} end
 * @property {[number, number]} sigma
 * @property {string} kind
 * @typedef {object} Tracking
 * @property {"none"|"tracking"|"done"|"failed"} state
 * @property {number} share
 * @property {boolean} paused
 * @property {Phrase|null} problem
 * @property {Record<string, number[]>} tracked
 * @property {Record<string, Phrase>} stopped
 * @typedef {object} Suggestion
 * @property {number} pulse
 * @property {string} camera
 * @property {string} thing
 * @property {string} why
 *
 * @typedef {object} CurvePoint
 * @property {number} pulse
 * @property {number} value
 * @property {number} sigma
 * @typedef {object} HandCurves
 * @property {"none"|"computing"|"done"|"failed"} state
 * @property {number} revision
 * @property {boolean} paused
 * @property {Phrase|null} problem
 * @property {Phrase[]} said
 * @property {Record<string, CurvePoint[]>} curves
 * @typedef {object} HandResult
 * @property {"none"|"computing"|"done"|"failed"} state
 * @property {string|null} step
 * @property {number} share
 * @property {boolean} paused
 * @property {Phrase|null} problem
 * @property {Phrase[]} said
 * @property {string[]} files
 *
 * @typedef {object} PointAgreement
 * @property {number} count
 * @property {number} sigma_px
 * @property {Record<string, Place>} bias_px
 * @typedef {object} FigureAgreement
 * @property {number} count
 * @property {number} sigma
 * @property {Record<string, number>} bias
 * @typedef {object} Repeatability
 * @property {string[]} operators
 * @property {Record<string, PointAgreement>} things
 * @property {Record<string, FigureAgreement>} figures
 * @property {Phrase[]} said
 */

export {};
