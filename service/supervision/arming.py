"""From what is there to what people want: arms, disarms, tries again after a fault."""

from dataclasses import replace
from typing import Final

from rig.api.statement import Statement
from rig.api.status import State
from rig.errors import StateForbidsError, SvevError
from rig.events import Level
from rig.phrase import phrase
from rig.settings.model import RigSettings
from rig.settings.trigger import ExternalTrigger
from service.processes.rig_programs import RECORDER
from service.processes.seen import Processes, Seen
from service.status.forbidden import FORBIDDEN
from service.status.statements import no_camera, too_few_cameras, wrong_rate
from service.supervision import recording
from service.supervision.changes import drop_trial, go_back, keep_trial, lacks_cameras, patience_s, refusal
from service.supervision.messages import (
    AnswerStatus,
    Arm,
    Disarm,
    Do,
    KillRecorder,
    RestartRecorder,
    RigFailed,
    Say,
    SetUp,
    TakeDown,
)
from service.supervision.phases import move
from service.supervision.situation import Goal, Heard, Moment, Settling, Situation
from triggering.timeline.steady_rate import SteadyRate

#: A camera that has not answered for this time after arming began counts as absent.
_CAMERA_ANSWERS_S: Final = 20.0
#: A recorder that has not reported for this time is stuck. Closing a log on a slow disk may take a while.
STUCK_S: Final = 20.0
#: Pulses whose rate differs from the rig file's by more than this share are those of another generator or another file.
_RATE_TOLERANCE: Final = 0.02


def arm(now: Situation, command: Arm, at: Moment, do: Do) -> Situation:
    """Begin to arm; after a fault, try again at once.

    Raises:
        StateForbidsError: the rig is being disarmed.
    """
    if now.state is State.DISARMING:
        raise StateForbidsError(FORBIDDEN["arm", now.state])
    do(AnswerStatus(command.answer))
    if command.min_cameras is not None and now.state not in {State.ARMED, State.RECORDING}:
        least = min(command.min_cameras, len(now.in_use.rig.cameras))
        now = replace(now, goal=replace(now.goal, least_cameras=least))
    if now.state is State.FAULT and _why_not(now) is None:
        return judge(now, at, do)
    if now.state not in {State.IDLE, State.FAULT}:
        return now
    now = replace(now, goal=replace(now.goal, armed=True), fault=now.fault.hurried())
    now = move(now, State.ARMING, at, do)
    if now.seen.processes is Processes.ALL:
        do(TakeDown(keep_hill=True))
    return now


def disarm(now: Situation, command: Disarm, _: Moment, do: Do) -> Situation:
    """Begin to disarm.

    Raises:
        StateForbidsError: a recording runs.
    """
    if now.state is State.RECORDING or now.recordings.current is not None:
        raise StateForbidsError(FORBIDDEN["disarm", State.RECORDING])
    do(AnswerStatus(command.answer))
    now = drop_trial(now, phrase("why_region_disarmed", "the rig was disarmed before it was tried"), do)
    return replace(now, goal=Goal(armed=False, least_cameras=now.in_use.rig.least_cameras))


def reconcile(now: Situation, at: Moment, do: Do) -> Situation:
    """Take one step from what is there to what is wanted; or none, if something must end first."""
    seen = now.seen
    if not now.goal.armed:
        return now if now.state is State.IDLE or now.recordings.current is not None else _rest(now, at, do)
    may_try = at.s >= now.fault.again_at and recording.may_restart(now, at)
    if seen.busy or not may_try or seen.processes is Processes.ALL:
        return now
    if now.state is not State.ARMING:
        now = move(now, State.ARMING, at, do)
    now = replace(now, settling=Settling(at.s, patience_s(now)), fault=now.fault.cleared())
    if seen.processes is Processes.NONE:
        do(SetUp())
        return now
    do(RestartRecorder())
    return recording.go_on(now, at, do)


def _rest(now: Situation, at: Moment, do: Do) -> Situation:
    if now.state is not State.DISARMING:
        now = move(replace(now, fault=now.fault.cleared()), State.DISARMING, at, do)
    if now.seen.empty:
        return move(now, State.IDLE, at, do)
    if not now.seen.busy:
        do(TakeDown(keep_hill=False))
    return now


def judge(now: Situation, at: Moment, do: Do) -> Situation:
    """Move between arming, armed and fault, depending on which cameras are connected."""
    seen = now.seen
    if seen.cameras is None or not now.goal.armed or now.recordings.current is not None:
        return now
    now, settled = _settled(now, at)
    fault = _why_not(now)
    present = any(camera.present for camera in seen.cameras)
    to = state_by_cameras(now.state, settled=settled or lacks_cameras(now), able=fault is None, any_present=present)
    if to is now.state:
        return now
    if now.state is State.ARMING:
        if (why := refusal(now, fault)) is not None:
            return go_back(now, why, at, do)
        now = keep_trial(now, do)
        now = replace(now, recordings=replace(now.recordings, armed_at=at.s, emptied_at=at.s))
    if fault is not None:  # its processes run on, and go on trying
        return move(replace(now, fault=replace(now.fault, statement=fault)), State.FAULT, at, do)
    if now.state is State.FAULT:
        now = replace(now, fault=now.fault.cleared())
    return move(now, State.ARMED, at, do)


def state_by_cameras(state: State, *, settled: bool, able: bool, any_present: bool) -> State:
    """The state that follows from the cameras, while the rig is to be armed and nothing is recorded.

    Args:
        state: the present state.
        settled: whether arming is done: all cameras have answered, or had time enough.
        able: whether enough cameras are there.
        any_present: whether at least one is.
    """
    match state:
        case State.ARMING if settled:
            return State.ARMED if able else State.FAULT
        case State.ARMED if not able and not any_present:
            return State.FAULT
        case State.FAULT if able:
            return State.ARMED
    return state


def rig_failed(now: Situation, failed: RigFailed, at: Moment, do: Do) -> Situation:
    """Setting up failed or the recorder died: try again later, or end if the loop does not endure that."""
    error = failed.error
    if now.trial is not None:
        return go_back(now, error.said, at, do)
    final: SvevError | None = error
    if now.loop.enduring and now.goal.armed:
        now, final = recording.interrupt(now, error, at, do)
    fault, said = now.fault.failed(error, at.s - now.settling.began, at.s, hurry=final is None)
    now = replace(now, fault=fault)
    if final is not None:
        now = recording.fail(now, final, State.FAULT, at, do)
    if not now.loop.enduring:
        return replace(now, loop=replace(now.loop, failure=fault.cause or error, ends_by=at.s))
    if not now.goal.armed:
        return now
    if now.state is not State.FAULT:
        now = move(now, State.FAULT, at, do)
    do(Say(Level.FATAL, RECORDER, said))
    return now


def expect_no_report(now: Situation, at: Moment) -> Situation:
    """While there is no recorder no report is late, and no pulses come."""
    if now.seen.processes is Processes.ALL:
        return now
    return replace(now, heard=Heard(at.s, limits=now.heard.limits))


def end_stuck_recorder(now: Situation, at: Moment, do: Do) -> Situation:
    """End a recorder that has sent no report for too long."""
    if now.seen.processes is Processes.ALL and at.s > max(now.heard.at, now.seen.started) + STUCK_S:
        said = phrase("event_recorder_stuck", "no sign of life for {seconds:g} s: it is ended", seconds=STUCK_S)
        do(Say(Level.FATAL, RECORDER, said))
        do(KillRecorder())
    return now


def why_not_armed(rig: RigSettings, seen: Seen, least: int) -> Statement | None:
    """What keeps a rig from being armed: too few cameras, or pulses at another rate than the rig file names.

    A generator that stands still is none of it: it may be started later.

    Args:
        rig: the rig.
        seen: its processes.
        least: so many cameras are needed.
    """
    if seen.cameras is None:
        return no_camera()
    if sum(camera.present for camera in seen.cameras) < least:
        return too_few_cameras(rig.cameras, seen.cameras, least)
    if seen.rate is not None and _contradicts(rig, seen.rate):
        return wrong_rate(seen.rate.hz, rig.trigger.rate_hz)
    return None


def _why_not(now: Situation) -> Statement | None:
    return why_not_armed(now.in_use.rig, now.seen, now.goal.least_cameras)


def _settled(now: Situation, at: Moment) -> tuple[Situation, bool]:
    """Whether every camera has answered or failed, and the connected ones have had time for their first frames.

    Pulses that seem to come at another rate than the rig file names get time, too, to be measured better.
    """
    seen, settling = now.seen, now.settling
    cameras = seen.cameras or ()
    tried = all(camera.tried for camera in cameras) or at.s > settling.began + _CAMERA_ANSWERS_S
    if not seen.ready or not tried:
        return now, False
    tried_at = at.s if settling.tried_at is None else settling.tried_at
    lacking = not any(camera.present for camera in cameras)
    sure = _contradicts(now.in_use.rig, seen.rate) is not None  # else the rate is told again soon
    settled = lacking or (seen.warm and sure) or at.s > tried_at + settling.patience_s
    return replace(now, settling=replace(settling, tried_at=tried_at)), settled


def _contradicts(rig: RigSettings, rate: SteadyRate | None) -> bool | None:
    """Whether pulses of a generator come at another rate than the rig file names; None: it is not measured well."""
    trigger = rig.trigger
    if rate is None or not isinstance(trigger, ExternalTrigger) or "rate_hz" not in trigger.model_fields_set:
        return False
    return rate.contradicts(trigger.rate_hz, _RATE_TOLERANCE)
