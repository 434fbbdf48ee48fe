"""Statements to people: state of the rig and of each camera in plain words, with what to do next.

Each has a code by which the page translates it, and a level which the page shows as colour and mark.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rig.api.jump import LastJump
from rig.api.statement import Level, Statement
from rig.api.status import CameraState, State
from rig.errors import SvevError
from rig.phrase import Phrase, Value, phrase, plain
from rig.phrases import in_turn
from rig.pulse import Pause
from rig.settings.camera import CameraSettings
from rig.transport.recorder_reports import CameraNews
from service.processes.seen import CameraPresence

_CAMERA_ADVICE: Final = "check its power and cable; it is connected again by itself"
_FASTER: Final = (
    "close other programs on it; if that is not enough, lower trigger.rate_hz or make the cameras' regions smaller"
)
_CAMERA_STATES: Final = {
    CameraNews.CONNECTED: CameraState.READY,
    CameraNews.SILENT: CameraState.SILENT,
    CameraNews.ABSENT: CameraState.ABSENT,
    CameraNews.GONE: CameraState.ABSENT,
}


def camera_state(trying: bool, heard: CameraPresence) -> CameraState:
    """The state of a camera.

    Args:
        trying: whether the rig is armed or being armed.
        heard: the last news of the camera.
    """
    if not trying:
        return CameraState.OFF
    return CameraState.CONNECTING if heard.news is None else _CAMERA_STATES[heard.news]


def about_camera(
    camera: CameraSettings, state: CameraState, said: Phrase, *, overloaded: bool, idle: bool
) -> Statement:
    """The state of a camera in words.

    Args:
        camera: the camera.
        state: its state.
        said: the last news of it, e.g. why it is not there.
        overloaded: whether the computer is too slow for several cameras: then silence tells nothing of a cable.
        idle: whether it has sent no frame for a second.
    """
    values: dict[str, Value] = {"camera": camera.name, "reason": said}
    match state:
        case CameraState.OFF:
            return Statement(code="camera_off", text=f"{camera.name} is off: the rig is not armed", values=values)
        case CameraState.CONNECTING:
            return Statement(code="camera_connecting", text=f"connecting {camera.name}", values=values)
        case CameraState.READY:
            return _connected(camera.name, values, idle=idle)
        case CameraState.SILENT if overloaded:
            what = f"the frames of {camera.name} come too late: this computer is too slow for the cameras"
            return Statement(level=Level.WARNING, code="camera_overloaded", text=what, advice=_FASTER, values=values)
        case CameraState.SILENT:
            what = f"{camera.name} sends no frames while the others do"
            advice = "check its trigger cable; it is connected again by itself"
            return Statement(level=Level.WARNING, code="camera_silent", text=what, advice=advice, values=values)
        case CameraState.ABSENT:
            return _absent(camera.name, said, values)


def _connected(camera: str, values: dict[str, Value], *, idle: bool) -> Statement:
    if idle:
        return Statement(
            code="camera_waits",
            text=f"{camera} is connected, but no frames come at present",
            advice="they come with the pulses: see whether those run",
            values=values,
        )
    return Statement(level=Level.GOOD, code="camera_ready", text=f"{camera} is ready", values=values)


def _absent(camera: str, said: Phrase, values: dict[str, Value]) -> Statement:
    if not said.text:
        what = f"{camera} is absent"
        return Statement(level=Level.ERROR, code="camera_absent", text=what, advice=_CAMERA_ADVICE, values=values)
    what = f"{camera} is absent: {said}"
    return Statement(level=Level.ERROR, code="camera_absent_why", text=what, advice=_CAMERA_ADVICE, values=values)


def about_state(
    state: State,
    cameras: Sequence[CameraSettings],
    states: Sequence[CameraState],
    arriving: bool,
    rate_hz: float | None,
    overloaded: Sequence[int],
    *,
    still: bool = False,
    gate_closed: bool = False,
) -> Statement:
    """The state of the rig in words; a fault is stated by `no_camera` or `failed`.

    Args:
        state: any but `FAULT`.
        cameras: the rig's cameras.
        states: the state of each of them.
        arriving: whether pulses arrive.
        rate_hz: pulses per second, None while unknown.
        overloaded: indices of the cameras whose frames come late or get lost because the computer is too slow.
        still: pulses are stopped, and come on request only.
        gate_closed: the gate outside lets no pulses through.
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
            code, text, rate = "state_recording", "recording", None
        case _ if still:
            return _still()
        case _ if gate_closed:
            code, text, rate = "state_gate_closed", "armed; pulses come when the gate opens", None
        case _ if not arriving:
            code, text, rate = "state_waiting", "armed, waiting for trigger pulses", None
        case _:
            pulses = "pulses arrive" if rate_hz is None else f"{rate_hz:.1f} pulses per second"
            code, text, rate = "state_armed", f"armed, {pulses}", rate_hz
    return _working(code, text, cameras, states, overloaded, rate)


def _still() -> Statement:
    return Statement(
        level=Level.WARNING,
        code="state_still",
        text="armed, but the pulses are stopped: nothing is held of the past; a recording starts them again",
        advice="start them under Check, or begin a recording",
    )


def rehearsing() -> Statement:
    """The state of a rig that is not armed and rehearses."""
    return Statement(
        code="state_rehearsing", text="not armed; a rehearsal is running", advice="to jump now, arm: that ends it"
    )


def _working(
    code: str,
    text: str,
    cameras: Sequence[CameraSettings],
    states: Sequence[CameraState],
    overloaded: Sequence[int],
    rate_hz: float | None = None,
) -> Statement:
    """Armed or recording. If cameras are missing, it works without them, and the statement says so.

    A camera that is absent matters more than a slow computer, and a slow computer more than the silence that it causes.
    """
    missing = [c.name for c, s in zip(cameras, states, strict=True) if s is not CameraState.READY]
    values: dict[str, Value] = {
        "present": len(cameras) - len(missing), "cameras": len(cameras), "missing": ", ".join(missing),
    }  # fmt: skip
    if rate_hz is not None:
        values["rate_hz"] = round(rate_hz, 2)
    if overloaded and CameraState.ABSENT not in states:
        late = ", ".join(cameras[index].name for index in overloaded)
        return Statement(
            level=Level.WARNING,
            code=f"{code}_overloaded",
            text=f"{text}, but this computer is too slow: frames of {late} come too late or get lost",
            advice=_FASTER,
            values=values | {"late": late},
        )
    if not missing:
        return Statement(level=Level.GOOD, code=code, text=text, values=values)
    if len(missing) == len(cameras):
        return Statement(
            level=Level.ERROR,
            code=f"{code}_none",
            text=f"{text}, but none of the {len(cameras)} cameras delivers",
            advice="see the cameras for what to do; a recording would be empty",
            values=values,
        )
    return Statement(
        level=Level.WARNING,
        code=f"{code}_partly",
        text=f"{text}, with {len(cameras) - len(missing)} of {len(cameras)} cameras: without {', '.join(missing)}",
        advice="recording works; see the camera for what to do",
        values=values,
    )


#: The states in words, for the log.
_STATES: Final = {
    State.IDLE: phrase("mode_idle", "idle"),
    State.ARMING: phrase("mode_arming", "arming"),
    State.ARMED: phrase("mode_armed", "armed"),
    State.RECORDING: phrase("mode_recording", "recording"),
    State.DISARMING: phrase("mode_disarming", "disarming"),
    State.FAULT: phrase("mode_fault", "fault"),
}


def moved(before: State, to: State, fault: Statement | None) -> Phrase:
    """The change from one state to another, with the fault if it is one."""
    left, entered = _STATES[before], _STATES[to]
    if fault is None:
        return phrase("event_moved", "{before} -> {to}", before=left, to=entered)
    return phrase("event_failed", "{before} -> {to}: {why}", before=left, to=entered, why=fault.said)


def measured(jump: LastJump) -> Phrase:
    """A jump was measured, live or in its log."""
    verdict = in_turn(jump.said) if jump.said else plain(jump.verdict)
    if jump.ok and jump.said:
        verdict = phrase("jump_measured_well", "measured well: {what}", what=verdict)
    text = "jump {jump} of {recording}: {verdict}"
    return phrase("event_jump", text, jump=jump.jump, recording=jump.recording, verdict=verdict)


def too_slow(late: Sequence[str]) -> Phrase:
    """The computer has become too slow for the cameras of these names."""
    text = "too slow: frames of {late} come too late or get lost; close other programs"
    return phrase("event_too_slow", text, late=", ".join(late))


def no_camera() -> Statement:
    """The fault that none of the cameras answers."""
    return Statement(
        level=Level.ERROR,
        code="fault_no_camera",
        text="none of the cameras answers",
        advice="check their power and cables; they are connected by themselves as soon as they answer",
    )


def too_few_cameras(cameras: Sequence[CameraSettings], heard: Sequence[CameraPresence], least: int) -> Statement:
    """The fault that fewer cameras answer than the rig file asks for.

    Args:
        cameras: the rig's cameras.
        heard: the last news of each of them.
        least: so many have to answer (`trigger.min_cameras`).
    """
    missing = [camera.name for camera, news in zip(cameras, heard, strict=True) if not news.present]
    present, names = len(cameras) - len(missing), ", ".join(missing)
    if not present:
        return no_camera()
    return Statement(
        level=Level.ERROR,
        code="fault_too_few",
        text=f"{present} of {len(cameras)} cameras answer, {least} are needed: without {names}",
        advice=f"check power and cables: when enough answer, the rig is armed by itself; or arm without {names}",
        values={"present": present, "cameras": len(cameras), "least": least, "missing": names},
    )


def wrong_rate(measured_hz: float, rate_hz: float) -> Statement:
    """The fault that pulses come at another rate than the rig file says.

    Args:
        measured_hz: their rate.
        rate_hz: that of the rig file.
    """
    return Statement(
        level=Level.ERROR,
        code="fault_wrong_rate",
        text=f"not armed: pulses come at {measured_hz:.1f} Hz, the rig file says rate_hz = {rate_hz:g}",
        advice="set the generator right, and the rig is armed by itself; or correct [trigger] rate_hz and start again",
        values={"measured": round(measured_hz, 1), "rate_hz": rate_hz},
    )


def failed(error: SvevError, again_in_s: float) -> Statement:
    """The fault that arming failed or a process died.

    Args:
        error: why.
        again_in_s: time until the service tries again.
    """
    return Statement(
        level=Level.ERROR,
        code="fault_failed",
        text=str(error),
        advice=f"it is tried again in {again_in_s:g} s; arm to try at once, disarm to stop trying",
        values={"reason": error.said, "again_in_s": again_in_s},
    )


def recording_ended(recording: str, error: SvevError) -> Statement:
    """A recording ended before it was stopped or its duration was over."""
    return Statement(
        level=Level.ERROR,
        code="recording_ended",
        text=f"recording {recording} ended early: {error}",
        advice="what was recorded until then is kept; see the recording's verdict",
        values={"recording": recording, "reason": error.said},
    )


def recording_forgotten(recording: str, longest_s: float) -> Statement:
    """A recording ended by itself after the longest time, because nobody stopped it."""
    return Statement(
        level=Level.WARNING,
        code="recording_forgotten",
        text=f"recording {recording} ended by itself after {longest_s:g} s: nobody had stopped it",
        advice="what was recorded is kept; recorder.longest_s of the rig file says how long",
        values={"recording": recording, "longest_s": longest_s},
    )


def recording_continued(recording: str, path: Path, reason: Phrase) -> Statement:
    """The log of a recording failed, and the recording goes on in another one.

    Args:
        recording: id of the log that failed.
        path: the log in which it goes on.
        reason: why the log failed.
    """
    return Statement(
        level=Level.ERROR,
        code="recording_continued",
        text=f"recording {recording} goes on in {path}: {reason}",
        advice="after it, look at the disk before the next recording",
        values={"recording": recording, "log": str(path), "reason": reason},
    )


def recording_resumed(before: str, recording: str, gap: Pause | None) -> Statement:
    """The recorder died, and a new one goes on with the recording in another log.

    Args:
        before: id of the log that the dead one wrote.
        recording: id of the log in which it goes on.
        gap: the pulses that are in neither; None: there are none.
    """
    values: dict[str, Value] = {"before": before, "recording": recording}
    text = f"the recorder was restarted, and recording {before} goes on in {recording}"
    if gap is None or gap.before_pulse is None:
        missing = "no pulse is missing"
    else:
        first, last = gap.after_pulse + 1, gap.before_pulse - 1
        which = f"pulse {first} is" if first == last else f"pulses {first} to {last} are"
        missing = f"{which} missing, {gap.seconds:.1f} s"
        values |= {"first": first, "last": last, "seconds": round(gap.seconds, 1)}
    advice = f"{before} was not closed, and is readable; svev recover closes it"
    return Statement(
        level=Level.WARNING,
        code="recording_resumed" if "first" in values else "recording_resumed_whole",
        text=f"{text}: {missing}",
        advice=advice,
        values=values,
    )


def pairing_alarm(said: Phrase, level: Level = Level.WARNING) -> Statement:
    """Something is wrong with clocks, trigger or rate.

    Args:
        said: what is wrong, as `triggering.alarms` says it; what to do stands behind
            its colon.
        level: how bad it is.
    """
    text, _, advice = said.text.partition(": ")
    values = {name: value for name, value in said.values.items() if not isinstance(value, Phrase)}
    return Statement(level=level, code=said.code, text=text, advice=advice, values=values)


def not_measured(why: Phrase) -> Statement:
    """Jumps cannot be measured while they are recorded.

    Args:
        why: what is wrong with survey or poses.
    """
    return Statement(
        level=Level.WARNING,
        code="alarm_not_measured",
        text=f"jumps are recorded, but not measured: {why}",
        advice="put that file right, it is read again by itself; if [analysis] in the rig file names the wrong one, "
        "correct that and restart the service",
        values={"why": why},
    )


def process_restarted(name: str, restarts: int) -> Statement:
    """A process died, and the supervisor started it again."""
    return Statement(
        level=Level.WARNING,
        code="process_restarted",
        text=f"{name} was started again {restarts} times",
        advice="if it recurs, run the doctor",
        values={"process": name, "restarts": restarts},
    )
