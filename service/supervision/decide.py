"""The decision: from a situation and a message to the next situation, and what is to be done about it.

A pure function: it asks no clock, reads no file, starts nothing. So every accident can be told as a table of situations
and messages (`tests/service/supervision`).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

from rig.phrase import phrase
from rig.transport.recorder_reports import (
    CameraLimits,
    RecorderFailed,
    RecorderHealth,
    RecorderReport,
    RecordingContinued,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
)
from service.recordings.in_progress import RecordingInProgress
from service.supervision import arming, changes, recording
from service.supervision import messages as m
from service.supervision.situation import Moment, Situation


def decide(now: Situation, message: m.Message, at: Moment) -> tuple[Situation, list[m.Effect]]:
    """What follows from a message.

    Args:
        now: the situation.
        message: what has happened, or is wanted.
        at: the present moment.

    Returns:
        The next situation; and the effects, in their order.

    Raises:
        SvevError: the command cannot be obeyed; the situation stays as it is.
    """
    effects: list[m.Effect] = []
    if isinstance(message, RecorderReport):
        now = replace(now, heard=replace(now.heard, at=at.s))
    if (follows := DECISIONS.get(type(message))) is not None:
        now = follows(now, message, at, effects.append)
    current = now.recordings.current
    if current is not None and (of_it := DECISIONS_IN_A_RECORDING.get(type(message))) is not None:
        now = of_it(now, current, message, at, effects.append)
    return now, effects


def is_over(now: Situation, at: Moment) -> bool:
    """Whether the loop may end: nobody wants it any more, and no recording is in progress or it is late."""
    ends_by = now.loop.ends_by
    return ends_by is not None and (now.recordings.current is None or at.s > ends_by)


def _turn_begins(now: Situation, _: m.TurnBegins, at: Moment, do: m.Do) -> Situation:
    """While the service is to end, the rig is not wanted, and a recording is finished first."""
    if now.loop.ends_by is not None:
        now = replace(now, goal=replace(now.goal, armed=False))
        current = now.recordings.current
        if current is not None and not current.stopping and not current.opening:
            now = recording.end(now, current, at, do)
    return arming.reconcile(arming.expect_no_report(now, at), at, do)


def _turn_ends(now: Situation, _: m.TurnEnds, at: Moment, do: m.Do) -> Situation:
    now = arming.judge(arming.end_stuck_recorder(now, at, do), at, do)
    return replace(now, loop=replace(now.loop, turned_at=at.s))


def _end(now: Situation, end: m.End, _: Moment, __: m.Do) -> Situation:
    return now if now.loop.ends_by is not None else replace(now, loop=replace(now.loop, ends_by=end.by))


def _loop_ends(now: Situation, end: m.LoopEnds, _: Moment, do: m.Do) -> Situation:
    now = changes.drop_trial(now, phrase("why_region_ending", "the service ends"), do)
    return replace(now, loop=replace(now.loop, failure=end.failure or now.loop.failure))


def _note(now: Situation, note: m.Note, at: Moment, do: m.Do) -> Situation:
    do(note)
    return _done(now, note, at, do)


def _done(now: Situation, command: m.Command[None], _: Moment, do: m.Do) -> Situation:
    """What the status board alone knows of, it has done."""
    do(m.Answer(command.answer, None))
    return now


def _shown(now: Situation, command: m.Acknowledge, _: Moment, do: m.Do) -> Situation:
    do(m.AnswerStatus(command.answer))
    return now


def _limits(now: Situation, report: CameraLimits, _: Moment, __: m.Do) -> Situation:
    name = now.in_use.rig.cameras[report.camera].name
    limits = MappingProxyType({**now.heard.limits, name: report.limits})
    return replace(now, heard=replace(now.heard, limits=limits))


def _health(now: Situation, report: RecorderHealth, at: Moment, _: m.Do) -> Situation:
    pulses = now.heard.pulses.counted(report.health.pairing.seen, at.s)
    return replace(now, heard=replace(now.heard, pulses=pulses))


def _complaint(now: Situation, report: RecorderFailed, _: Moment, __: m.Do) -> Situation:
    """What the recorder says that is about no recording is why it ends soon."""
    if now.recordings.current is not None:
        return now
    return replace(now, fault=replace(now.fault, complaint=report.error()))


#: What follows from a message, by its type. From others nothing does.
DECISIONS: Final[Mapping[type, Callable[[Situation, Any, Moment, m.Do], Situation]]] = MappingProxyType(
    {
        m.Arm: arming.arm,
        m.Disarm: arming.disarm,
        m.Start: recording.start,
        m.Begin: recording.begin,
        m.Stop: recording.stop,
        m.Close: recording.close,
        m.ChangeSession: recording.change_session,
        m.RunTrain: changes.change_train,
        m.Burst: changes.burst,
        m.ChangeCamera: changes.change_camera,
        m.ChangeCalibration: changes.change_calibration,
        m.ChangeParts: changes.change_parts,
        m.ChangeRate: changes.change_rate,
        m.ChangeRegion: changes.change_region,
        m.Note: _note,
        m.Acknowledge: _shown,
        m.MotionSeen: _done,
        m.NotBegun: _done,
        m.JumpsKnown: _done,
        m.TurnBegins: _turn_begins,
        m.TurnEnds: _turn_ends,
        m.RigFailed: arming.rig_failed,
        m.LogPrepared: recording.prepared,
        m.End: _end,
        m.LoopEnds: _loop_ends,
        CameraLimits: _limits,
        RecorderHealth: _health,
        RecorderFailed: _complaint,
    }
)
#: What follows in a recording that is in progress.
DECISIONS_IN_A_RECORDING: Final[
    Mapping[type, Callable[[Situation, RecordingInProgress, Any, Moment, m.Do], Situation]]
] = MappingProxyType(
    {
        m.LogNamed: recording.named,
        m.LogGrown: recording.grown,
        m.LogRead: recording.read,
        m.ProcessesEnded: recording.abandoned,
        RecordingStarted: recording.started,
        RecordingProgress: recording.progressed,
        RecordingContinued: recording.continued,
        RecordingFinished: recording.finished,
        RecorderHealth: recording.measured,
        RecorderFailed: recording.refused,
    }
)
