"""What a state of the rig forbids, and in what words."""

from typing import Final

from rig.api.status import State
from rig.phrase import Phrase, phrase

#: Why a state forbids a call, and what to do, by call and state.
FORBIDDEN: Final[dict[tuple[str, State], Phrase]] = {
    ("arm", State.DISARMING): phrase(
        "forbidden_arm_disarming", "the rig is being disarmed: wait until that is done, then arm"
    ),
    ("rehearse", State.ARMING): phrase("forbidden_rehearse_arming", "the rig is being armed: disarm it, then rehearse"),
    ("rehearse", State.ARMED): phrase(
        "forbidden_rehearse_armed",
        "the rig is armed, and a rehearsal needs the cameras for itself: disarm, then rehearse",
    ),
    ("rehearse", State.RECORDING): phrase(
        "forbidden_rehearse_recording", "a recording is running: stop it and disarm, then rehearse"
    ),
    ("rehearse", State.DISARMING): phrase(
        "forbidden_rehearse_disarming", "the rig is being disarmed: wait until that is done, then rehearse"
    ),
    ("rehearse", State.FAULT): phrase("forbidden_rehearse_fault", "the rig has a fault: disarm it, then rehearse"),
    ("expose", State.ARMING): phrase(
        "forbidden_expose_arming", "the rig is being armed: wait until it is armed, then change exposure or gain"
    ),
    ("expose", State.ARMED): phrase(
        "forbidden_expose_armed", "a recording is about to start: stop it, then change exposure or gain"
    ),
    ("expose", State.RECORDING): phrase(
        "forbidden_expose_recording", "a recording is running: stop it, then change exposure or gain"
    ),
    ("expose", State.DISARMING): phrase(
        "forbidden_expose_disarming", "the rig is being disarmed: wait until that is done, then change exposure or gain"
    ),
    ("expose", State.FAULT): phrase(
        "forbidden_expose_fault", "the rig is being tried again: wait a moment, then change exposure or gain"
    ),
    ("rate", State.ARMING): phrase(
        "forbidden_rate_arming", "the rig is being armed: wait until it is armed, then change the rate"
    ),
    ("rate", State.ARMED): phrase(
        "forbidden_rate_armed", "a recording is about to start: stop it, then change the rate"
    ),
    ("rate", State.RECORDING): phrase(
        "forbidden_rate_recording", "a recording is running: stop it, then change the rate"
    ),
    ("rate", State.DISARMING): phrase(
        "forbidden_rate_disarming", "the rig is being disarmed: wait until that is done, then change the rate"
    ),
    ("rate", State.FAULT): phrase(
        "forbidden_rate_fault", "the rig is being tried again: wait a moment, then change the rate"
    ),
    ("region", State.ARMING): phrase(
        "forbidden_region_arming", "the rig is being armed: wait until it is armed, then change the region"
    ),
    ("region", State.ARMED): phrase(
        "forbidden_region_armed", "a recording is about to start: stop it, then change the region"
    ),
    ("region", State.RECORDING): phrase(
        "forbidden_region_recording", "a recording is running: stop it, then change the region"
    ),
    ("region", State.DISARMING): phrase(
        "forbidden_region_disarming", "the rig is being disarmed: wait until that is done, then change the region"
    ),
    ("region", State.FAULT): phrase(
        "forbidden_region_fault", "the rig is being tried again: wait a moment, then change the region"
    ),
    ("calibrate", State.ARMING): phrase(
        "forbidden_calibrate_arming", "the rig is being armed: wait until it is armed, then use the calibration"
    ),
    ("calibrate", State.ARMED): phrase(
        "forbidden_calibrate_armed", "a recording is about to start: stop it, then use the calibration"
    ),
    ("calibrate", State.RECORDING): phrase(
        "forbidden_calibrate_recording", "a recording is running: stop it, then use the calibration"
    ),
    ("calibrate", State.DISARMING): phrase(
        "forbidden_calibrate_disarming", "the rig is being disarmed: wait until that is done, then use the calibration"
    ),
    ("calibrate", State.FAULT): phrase(
        "forbidden_calibrate_fault", "the rig is being tried again: wait a moment, then use the calibration"
    ),
    ("pulses", State.IDLE): phrase(
        "forbidden_pulses_idle", "the rig is not armed: arm it, then stop or ask for pulses"
    ),
    ("pulses", State.ARMING): phrase(
        "forbidden_pulses_arming", "the rig is being armed: wait until it is armed, then stop or ask for pulses"
    ),
    ("pulses", State.RECORDING): phrase(
        "forbidden_pulses_recording", "a recording is running: stop it, then stop or ask for pulses"
    ),
    ("pulses", State.DISARMING): phrase(
        "forbidden_pulses_disarming", "the rig is being disarmed: arm it again, then stop or ask for pulses"
    ),
    ("pulses", State.FAULT): phrase(
        "forbidden_pulses_fault", "the rig has a fault: see its statement for what to do, then stop or ask for pulses"
    ),
    ("disarm", State.RECORDING): phrase("forbidden_disarm_recording", "a recording is running: stop it, then disarm"),
    ("start", State.IDLE): phrase("forbidden_start_idle", "the rig is not armed: arm it, then start recording"),
    ("start", State.ARMING): phrase(
        "forbidden_start_arming", "the rig is being armed: wait until it is armed, then start recording"
    ),
    ("start", State.RECORDING): phrase(
        "forbidden_start_recording", "a recording is running: stop it before starting another"
    ),
    ("start", State.DISARMING): phrase(
        "forbidden_start_disarming", "the rig is being disarmed: arm it again, then start recording"
    ),
    ("start", State.FAULT): phrase(
        "forbidden_start_fault", "the rig has a fault: see its statement for what to do, then start recording"
    ),
}
