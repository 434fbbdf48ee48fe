"""What the service says to people: states and cameras in plain words, with what to do next."""

from collections.abc import Sequence

from recorder.assembler import CameraState as Heard
from rig.errors import SvevError
from rig.settings import CameraSettings
from svev.rig_processes import CameraPresence
from webpanel.models import CameraState, Level, State, Statement

_CAMERA_ADVICE = "check its power and cable; it is connected again by itself"


def camera_state(trying: bool, heard: CameraPresence) -> CameraState:
    """The camera's state in the panel's words."""
    if not trying:
        return CameraState.OFF
    match heard.state:
        case Heard.CONNECTED:
            return CameraState.READY
        case Heard.SILENT:
            return CameraState.SILENT
        case Heard.GONE:
            return CameraState.ABSENT
        case _:
            return CameraState.CONNECTING


def about_camera(camera: CameraSettings, state: CameraState, text: str) -> Statement:
    """One camera in words.

    Args:
        camera: the camera.
        state: what it does.
        text: what was last heard of it.
    """
    values: dict[str, str | int | float] = {"camera": camera.name, "reason": text}
    match state:
        case CameraState.OFF:
            return Statement(code="camera_off", text=f"{camera.name} is off: the rig is not armed", values=values)
        case CameraState.CONNECTING:
            return Statement(code="camera_connecting", text=f"connecting {camera.name}", values=values)
        case CameraState.READY:
            return Statement(level=Level.GOOD, code="camera_ready", text=f"{camera.name} is ready", values=values)
        case CameraState.SILENT:
            what = f"{camera.name} sends no frames while the others do"
            advice = "check its trigger cable; it is connected again by itself"
            return Statement(level=Level.WARNING, code="camera_silent", text=what, advice=advice, values=values)
        case CameraState.ABSENT:
            what = f"{camera.name} is absent" + (f": {text}" if text else "")
            return Statement(level=Level.ERROR, code="camera_absent", text=what, advice=_CAMERA_ADVICE, values=values)


def about_state(
    state: State,
    cameras: Sequence[CameraSettings],
    states: Sequence[CameraState],
    arriving: bool,
    rate_hz: float | None,
) -> Statement:
    """A state that is not a fault, in words.

    Args:
        state: the state.
        cameras: the rig's cameras.
        states: what each of them does.
        arriving: whether pulses arrive.
        rate_hz: their rate, None while it is not known.
    """
    match state:
        case State.IDLE:
            return Statement(code="state_idle", text="not armed", advice="arm the rig to connect the cameras")
        case State.ARMING:
            waiting = [c.name for c, s in zip(cameras, states, strict=True) if s is CameraState.CONNECTING]
            names = ", ".join(waiting)
            text = f"connecting {names}" if names else "getting ready"
            return Statement(code="state_arming", text=text, values={"cameras": names})
        case State.DISARMING:
            return Statement(code="state_disarming", text="disconnecting the cameras")
        case State.RECORDING:
            return _working("state_recording", "recording", cameras, states)
        case _ if not arriving:
            return _working("state_waiting", "armed, waiting for trigger pulses", cameras, states)
        case _:
            pulses = "pulses arrive" if rate_hz is None else f"{rate_hz:.1f} pulses per second"
            return _working("state_armed", f"armed, {pulses}", cameras, states, rate_hz)


def _working(
    code: str,
    text: str,
    cameras: Sequence[CameraSettings],
    states: Sequence[CameraState],
    rate_hz: float | None = None,
) -> Statement:
    """Armed or recording: all is well if no camera is missing; with some missing it works, and says so."""
    missing = [c.name for c, s in zip(cameras, states, strict=True) if s is not CameraState.READY]
    values: dict[str, str | int | float] = {
        "present": len(cameras) - len(missing), "cameras": len(cameras), "missing": ", ".join(missing),
    }  # fmt: skip
    if rate_hz is not None:
        values["rate_hz"] = round(rate_hz, 2)
    if not missing:
        return Statement(level=Level.GOOD, code=code, text=text, values=values)
    return Statement(
        level=Level.WARNING,
        code=f"{code}_partly",
        text=f"{text}, with {len(cameras) - len(missing)} of {len(cameras)} cameras: without {', '.join(missing)}",
        advice="recording works; see the camera for what to do",
        values=values,
    )


def no_camera() -> Statement:
    """None of the cameras answers."""
    return Statement(
        level=Level.ERROR,
        code="fault_no_camera",
        text="none of the cameras answers",
        advice="check their power and cables; they are connected by themselves as soon as they answer",
    )


def failed(error: SvevError, again_in_s: float) -> Statement:
    """Arming failed or a process died; it is tried again.

    Args:
        error: why.
        again_in_s: when, s.
    """
    return Statement(
        level=Level.ERROR,
        code="fault_failed",
        text=str(error),
        advice=f"it is tried again in {again_in_s:g} s; arm to try at once, disarm to stop trying",
        values={"reason": str(error), "again_in_s": again_in_s},
    )


def recording_ended(recording: str, error: SvevError) -> Statement:
    """A recording came to an end that nobody wanted."""
    return Statement(
        level=Level.ERROR,
        code="recording_ended",
        text=f"recording {recording} ended early: {error}",
        advice="what was recorded until then is kept; see the recording's verdict",
        values={"recording": recording, "reason": str(error)},
    )


def process_restarted(name: str, restarts: int) -> Statement:
    """A process died and was started again."""
    return Statement(
        level=Level.WARNING,
        code="process_restarted",
        text=f"{name} was started again {restarts} times",
        advice="if it recurs, run the doctor",
        values={"process": name, "restarts": restarts},
    )


FORBIDDEN: dict[tuple[str, State], str] = {
    ("arm", State.DISARMING): "the rig is being disarmed: wait until that is done, then arm",
    ("disarm", State.RECORDING): "a recording is running: stop it, then disarm",
    ("start", State.IDLE): "the rig is not armed: arm it, then start recording",
    ("start", State.ARMING): "the rig is being armed: wait until it is armed, then start recording",
    ("start", State.RECORDING): "a recording is running: stop it before starting another",
    ("start", State.DISARMING): "the rig is being disarmed: arm it again, then start recording",
    ("start", State.FAULT): "the rig has a fault: see its statement for what to do, then start recording",
}
