"""What a state of the rig forbids, and in what words."""

from typing import Final

from rig.api.status import State
from rig.phrase import Phrase, phrase

#: Changes of the rig in use, by call.
_CHANGES: Final = {
    "expose": phrase("change_light", "change exposure or gain"),
    "rate": phrase("change_rate", "change the rate"),
    "region": phrase("change_region", "change the region"),
    "calibrate": phrase("change_calibration", "use the calibration"),
}


def _no_change(change: Phrase) -> dict[State, Phrase]:
    """Why a state forbids a change, and what to do."""
    return {
        State.ARMING: phrase(
            "forbidden_change_arming", "the rig is being armed: wait until it is armed, then {change}", change=change
        ),
        State.ARMED: phrase(
            "forbidden_change_armed", "a recording is about to start: stop it, then {change}", change=change
        ),
        State.RECORDING: phrase(
            "forbidden_change_recording", "a recording is running: stop it, then {change}", change=change
        ),
        State.DISARMING: phrase(
            "forbidden_change_disarming",
            "the rig is being disarmed: wait until that is done, then {change}",
            change=change,
        ),
        State.FAULT: phrase(
            "forbidden_change_fault", "the rig is being tried again: wait a moment, then {change}", change=change
        ),
    }


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
} | {(call, state): why for call, change in _CHANGES.items() for state, why in _no_change(change).items()}
