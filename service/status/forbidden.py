"""What a state of the rig forbids, and in what words."""

from typing import Final

from rig.api.status import State

#: Why a state forbids a call, and what to do, by call and state.
FORBIDDEN: Final[dict[tuple[str, State], str]] = {
    ("arm", State.DISARMING): "the rig is being disarmed: wait until that is done, then arm",
    ("rehearse", State.ARMING): "the rig is being armed: disarm it, then rehearse",
    ("rehearse", State.ARMED): "the rig is armed, and a rehearsal needs the cameras for itself: disarm, then rehearse",
    ("rehearse", State.RECORDING): "a recording is running: stop it and disarm, then rehearse",
    ("rehearse", State.DISARMING): "the rig is being disarmed: wait until that is done, then rehearse",
    ("rehearse", State.FAULT): "the rig has a fault: disarm it, then rehearse",
    ("expose", State.ARMING): "the rig is being armed: wait until it is armed, then change exposure or gain",
    ("expose", State.ARMED): "a recording is about to start: stop it, then change exposure or gain",
    ("expose", State.RECORDING): "a recording is running: stop it, then change exposure or gain",
    ("expose", State.DISARMING): "the rig is being disarmed: wait until that is done, then change exposure or gain",
    ("expose", State.FAULT): "the rig is being tried again: wait a moment, then change exposure or gain",
    ("rate", State.ARMING): "the rig is being armed: wait until it is armed, then change the rate",
    ("rate", State.ARMED): "a recording is about to start: stop it, then change the rate",
    ("rate", State.RECORDING): "a recording is running: stop it, then change the rate",
    ("rate", State.DISARMING): "the rig is being disarmed: wait until that is done, then change the rate",
    ("rate", State.FAULT): "the rig is being tried again: wait a moment, then change the rate",
    ("region", State.ARMING): "the rig is being armed: wait until it is armed, then change the region",
    ("region", State.ARMED): "a recording is about to start: stop it, then change the region",
    ("region", State.RECORDING): "a recording is running: stop it, then change the region",
    ("region", State.DISARMING): "the rig is being disarmed: wait until that is done, then change the region",
    ("region", State.FAULT): "the rig is being tried again: wait a moment, then change the region",
    ("pulses", State.IDLE): "the rig is not armed: arm it, then stop or ask for pulses",
    ("pulses", State.ARMING): "the rig is being armed: wait until it is armed, then stop or ask for pulses",
    ("pulses", State.RECORDING): "a recording is running: stop it, then stop or ask for pulses",
    ("pulses", State.DISARMING): "the rig is being disarmed: arm it again, then stop or ask for pulses",
    ("pulses", State.FAULT): "the rig has a fault: see its statement for what to do, then stop or ask for pulses",
    ("disarm", State.RECORDING): "a recording is running: stop it, then disarm",
    ("start", State.IDLE): "the rig is not armed: arm it, then start recording",
    ("start", State.ARMING): "the rig is being armed: wait until it is armed, then start recording",
    ("start", State.RECORDING): "a recording is running: stop it before starting another",
    ("start", State.DISARMING): "the rig is being disarmed: arm it again, then start recording",
    ("start", State.FAULT): "the rig has a fault: see its statement for what to do, then start recording",
}
