/**
 * The shapes of the answers of the REST API, as in rig/api (a test compares them).
 *
 * @typedef {"idle"|"arming"|"armed"|"recording"|"disarming"|"fault"} State
 * @typedef {"good"|"info"|"warning"|"error"} Level
 *
 * @typedef {object} Phrase A sentence in another one.
 * @property {string} code
 * @property {string} text
 * @property {Values} values
 * @typedef {{ [name: string]: string|number|Phrase }} Values What a sentence is filled in with.
 *
 * @typedef {object} Statement One thing to tell a person, translatable by its code.
 * @property {Level} level
 * @property {string} code
 * @property {string} text
 * @property {string} advice
 * @property {Values} values
 *
 * @typedef {object} CameraStatus
 * @property {string} name
 * @property {string} backend
 * @property {string} address
 * @property {"off"|"connecting"|"ready"|"silent"|"absent"} state
 * @property {Statement} statement
 * @property {number|null} frames_per_s
 * @property {number} frames
 * @property {number} damaged
 * @property {number} resent_packets
 * @property {number} reconnects
 * @property {number|null} temperature_c
 * @property {number|null} clock_offset_us
 * @property {[number, number]|null} columns
 * @property {ActionAnswers|null} actions
 * @typedef {object} ActionAnswers
 * @property {number} acknowledged
 * @property {number} late
 * @property {number} refused
 * @property {number} unanswered
 *
 * @typedef {object} PulseStatus
 * @property {boolean} arriving
 * @property {boolean} running
 * @property {number|null} rate_hz
 * @property {number|null} spread_us
 * @property {number} number
 * @property {number|null} fired
 * @property {MadePulses|null} made
 * @typedef {object} MadePulses
 * @property {number} made
 * @property {number} skipped
 * @property {number|null} late_median_us
 * @property {number|null} late_p99_us
 * @property {number|null} late_max_us
 * @property {boolean} realtime
 * @property {boolean|null} gate_open
 *
 * @typedef {object} DiskStatus
 * @property {number} free_gb
 * @property {number} trash_gb
 * @property {number} reserve_gb
 * @property {number} seconds_left
 * @property {number} jumps_left
 * @property {number} jump_s
 *
 * @typedef {object} PrerollStatus
 * @property {number} seconds
 * @property {number} limit_s
 * @property {number} memory_mb
 *
 * @typedef {object} Causes
 * @property {number} lost
 * @property {number} missed
 * @property {number} damaged
 * @property {number} absent
 * @typedef {object} Counts
 * @property {number} pulses
 * @property {number} complete
 * @property {number} partial
 * @property {Causes} causes
 *
 * @typedef {object} ProcessStatus
 * @property {string} name
 * @property {number|null} pid
 * @property {number} restarts
 * @property {Statement|null} statement
 *
 * @typedef {object} SessionFields
 * @property {string} athlete
 * @property {string} bib
 * @property {string} gate
 * @property {string} wind
 * @property {string} notes
 * @property {string} operator
 *
 * @typedef {object} Recording
 * @property {string} id
 * @property {"recording"|"finished"|"unfinished"|"damaged"} state
 * @property {string|null} started
 * @property {number} duration_s
 * @property {number} bytes
 * @property {Counts} counts
 * @property {SessionFields} session
 * @property {Statement} verdict
 * @property {boolean} deleted
 * @property {boolean} favourite
 * @property {string[]} tags
 * @property {Record<string, string>} more round, club and own columns of the start list
 * @property {string} continues id of the recording of which this is the next part
 * @property {string} continued_by id of the recording that is the next part of this one
 * @property {string[]} parts ids of the logs that the recording is split into, in their order
 *
 * @typedef {object} Trash
 * @property {number} recordings
 * @property {number} bytes
 * @typedef {object} PulseSummary
 * @property {number} pulse
 * @property {number} time_s
 * @property {string[]} statuses
 * @typedef {object} Pulses
 * @property {string} id
 * @property {string[]} cameras
 * @property {[number, number][]} columns
 * @property {[number, number]} shape
 * @property {PulseSummary[]} pulses
 *
 * @typedef {object} Event Something that happened.
 * @property {number} number
 * @property {string} time
 * @property {"debug"|"info"|"warning"|"error"|"fatal"} level
 * @property {string} name
 * @property {string} message
 * @property {string} code
 * @property {Values} values
 *
 * @typedef {object} MeasuredValue
 * @property {number} value
 * @property {number} sigma
 *
 * @typedef {object} LastJump
 * @property {string} recording
 * @property {number} jump
 * @property {string} time
 * @property {boolean} live
 * @property {boolean} ok
 * @property {string} verdict
 * @property {Phrase[]} said
 * @property {MeasuredValue|null} takeoff_speed
 * @property {MeasuredValue|null} perpendicular
 * @property {MeasuredValue|null} speed_20_m
 * @property {MeasuredValue|null} angle_of_attack
 * @property {MeasuredValue|null} ski_to_body
 *
 * @typedef {object} MeasuringQueue
 * @property {string|null} recording
 * @property {"none"|"waiting"|"measuring"|"done"|"failed"} state
 * @property {boolean} paused
 * @property {"balls"|"search"|"names"|"computing"|"writing"|"video"|"copying"|"renaming"|null} step
 * @property {number} share
 * @property {number} waiting
 *
 * @typedef {object} TapGuard
 * @property {number} number
 * @property {number} hold_s
 * @property {number} confirm_s
 *
 * @typedef {object} NextJumper
 * @property {number} number
 * @property {number} version
 * @property {number|null} line
 * @property {number|null} following
 * @property {SessionFields} session
 * @property {Record<string, string>} more
 *
 * @typedef {object} StartLine
 * @property {string} bib
 * @property {string} athlete
 * @property {string} gate
 * @property {string} club
 * @property {string} notes
 * @property {Record<string, string>} more
 * @property {number} id
 * @property {"waiting"|"jumped"|"skipped"} mark
 * @property {string[]} jumps
 * @typedef {object} StartList
 * @property {number} version
 * @property {number} round
 * @property {boolean} auto_advance
 * @property {string[]} carry
 * @property {string[]} columns
 * @property {StartLine[]} lines
 * @property {NextJumper} next
 * @property {Statement|null} undo
 *
 * @typedef {object} RehearsalProgress
 * @property {"connecting"|"recording"|"reading"} stage
 * @property {number} done
 * @property {number} pulses
 *
 * @typedef {{ number: number, topic: string, since: string, statement: Statement, acknowledged: boolean }} Alarm
 *
 * @typedef {object} Status
 * @property {State} state
 * @property {string} since
 * @property {Statement} statement
 * @property {Alarm[]} alarms
 * @property {Statement|null} notice
 * @property {TapGuard} guard
 * @property {string} rig
 * @property {string} version
 * @property {CameraStatus[]} cameras
 * @property {PulseStatus} pulses
 * @property {PrerollStatus} preroll
 * @property {DiskStatus} disk
 * @property {Recording|null} recording
 * @property {string|null} last_recording
 * @property {LastJump|null} last_jump
 * @property {MeasuringQueue} measuring
 * @property {NextJumper} next_jumper
 * @property {{ on: boolean, camera: string }|null} automatic
 * @property {RehearsalProgress|null} rehearsal
 * @property {ProcessStatus[]} processes
 *
 * @typedef {object} Finding
 * @property {"PASS"|"WARN"|"FAIL"} level
 * @property {string} topic
 * @property {string} code
 * @property {string} what
 * @property {string} remedy
 * @property {Values} values
 * @typedef {object} DoctorReport
 * @property {"PASS"|"WARN"|"FAIL"} worst
 * @property {Finding[]} findings
 *
 * @typedef {object} Rehearsal
 * @property {"ready"|"warned"|"not_ready"|"failed"} verdict
 * @property {Statement} statement
 * @property {string} line
 * @property {string} ended
 * @property {number} seconds
 * @property {number} pulses
 * @property {number} complete
 * @property {Record<string, number>} headroom
 * @property {number|null} jumps
 * @property {number|null} spread_us
 * @property {Finding[]} findings
 */

export {};
