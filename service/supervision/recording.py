"""Starts, follows and ends recordings: what follows from orders and from the recorder's reports."""

from dataclasses import replace

import msgspec

from rig.api.recordings import RecordingOrder
from rig.api.statement import Statement
from rig.api.status import State
from rig.clocks import NS_PER_S
from rig.errors import NameTakenError, ProcessDiedError, StateForbidsError, SvevError, UnknownRecordingError
from rig.events import Level
from rig.phrase import phrase
from rig.transport.recorder_commands import Calibration, StartRecording, StopRecording
from rig.transport.recorder_reports import (
    RecorderFailed,
    RecorderHealth,
    RecordingContinued,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
)
from service.processes.seen import Processes
from service.recordings.in_progress import Outcome, RecordingInProgress
from service.recordings.interruption import (
    DEATHS_MAX,
    DEATHS_WITHIN_S,
    LOG_READ_S,
    Interruption,
    died_too_often,
    going_on,
)
from service.status.forbidden import FORBIDDEN
from service.status.statements import (
    recording_continued,
    recording_ended,
    recording_forgotten,
    recording_resumed,
)
from service.supervision.changes import run_train
from service.supervision.messages import (
    Answer,
    Begin,
    ChangeSession,
    Close,
    Do,
    GiveBack,
    LogGrown,
    LogNamed,
    LogOpened,
    LogPrepared,
    LogRead,
    LogsClosed,
    MeasureLog,
    NameLog,
    Order,
    PrepareLog,
    ProcessesEnded,
    ReadLog,
    Refuse,
    RenameTaken,
    Say,
    Start,
    Stop,
)
from service.supervision.phases import move
from service.supervision.situation import Moment, RigInUse, Situation
from service.supervision.tap_guard import CONFIRM_S, check_seen, check_stop


def start(now: Situation, command: Start, at: Moment, do: Do) -> Situation:
    """Have a log prepared for the jumper whom the order names, or for the next one.

    Raises:
        StateForbidsError: not armed, or a recording is being opened, or the order may be a second tap.
    """
    check_seen(now.phase, command.order.seen, at.s, opening=now.recordings.current is not None)
    _check_armed(now)
    do(PrepareLog(command))
    return now


def prepared(now: Situation, log: LogPrepared, at: Moment, do: Do) -> Situation:
    """Have the recorder open the log; the train of pulses starts, if it stands still, but not for the past alone."""
    order, recorder = log.command.order, now.in_use.rig.recorder
    told = StartRecording(
        path=log.path,
        session={name: text for name, text in ({**log.more} | log.session.model_dump()).items() if text},
        seconds=recorder.longest_s if order.duration_s is None else order.duration_s,
        nobody_stops=order.duration_s is None,
        commanded=at.host,
        preroll_s=_reach_s(now, order, at),
        keep_s=CONFIRM_S,
    )
    now = begin(now, Begin(log.command.answer, told, log.session), at, do)
    return run_train(now, do, running=True) if now.seen.still and order.duration_s != 0 else now


def begin(now: Situation, command: Begin, at: Moment, do: Do) -> Situation:
    """Have the recorder open a log.

    Raises:
        StateForbidsError: not armed, or a recording is being opened.
    """
    _check_armed(now)
    recorder = now.in_use.rig.recorder
    told = msgspec.structs.replace(
        command.start, rig_toml=now.in_use.toml, calibration=_fitting(now.in_use),
        part_s=recorder.part_s, part_gb=recorder.part_gb,
    )  # fmt: skip
    waiting = () if command.ended is None else (command.ended,)
    current = RecordingInProgress(
        told, command.session, at.utc, at.host, told.path, (told.path,), command.answer, waiting
    )
    do(Order(told))
    return replace(now, recordings=replace(now.recordings, current=current, notice=None))


def stop(now: Situation, command: Stop, at: Moment, do: Do) -> Situation:
    """Have the recorder close the log, because somebody wants it.

    Raises:
        UnknownRecordingError: this recording is not in progress.
        StateForbidsError: the order may be a second tap.
    """
    current = now.recordings.current
    if current is None or command.recording not in current.ids:
        raise UnknownRecordingError(f"recording {command.recording} is not in progress: see the list of recordings")
    if not current.stopping:
        check_stop(now.phase, command.order, at.s)
    current = replace(current, waiting=(*current.waiting, command.answer))
    fresh = now.phase.age_s(at.s) < CONFIRM_S and not current.deaths
    return end(_with(now, current), current, at, do, mishap=command.order.confirm and fresh)


def close(now: Situation, command: Close, at: Moment, do: Do) -> Situation:
    """Have the recorder close the log.

    Raises:
        UnknownRecordingError: nothing is being recorded.
    """
    if (current := now.recordings.current) is None:
        raise UnknownRecordingError("no recording is in progress: see the list of recordings")
    do(Answer(command.answer, None))
    return end(now, current, at, do, at_once=command.at_once)


def end(
    now: Situation,
    current: RecordingInProgress,
    at: Moment,
    do: Do,
    *,
    at_once: bool = False,
    mishap: bool = False,
) -> Situation:
    """Have the recorder close the log; a second time only to stop waiting for the disk.

    Args:
        now: the situation.
        current: the recording.
        at: the present moment.
        do: takes effects.
        at_once: do not wait for the disk.
        mishap: somebody stopped it as soon as it had begun: its jumper is to jump again, and memory keeps its pulses.
    """
    if current.interruption is not None and not current.interruption.resumed:
        return fail(now, current.interruption.error, now.state, at, do)
    if now.seen.processes is Processes.NONE or (current.stopping and not at_once):
        return now
    if mishap:
        do(GiveBack(current.ids[0]))
    do(Order(StopRecording(at_once=at_once, keep=mishap)))
    return _with(now, replace(current, stopping=True, mishap=mishap))


def change_session(now: Situation, command: ChangeSession, at: Moment, do: Do) -> Situation:
    """Change session fields of the recording in progress."""
    current = now.recordings.current
    if current is None or command.recording not in current.ids:
        do(Answer(command.answer, None))
        return now
    current = current.with_session(command.change)
    do(Answer(command.answer, current.view(at.utc)))
    return _with(now, current)


def named(now: Situation, current: RecordingInProgress, log: LogNamed, _: Moment, do: Do) -> Situation:
    """Order a recording under another name: another program has made a log of its name meanwhile."""
    renamed = current.renamed(log.path)
    do(RenameTaken(current.id, renamed.id))
    do(Order(renamed.order))
    return _with(now, renamed)


def grown(now: Situation, current: RecordingInProgress, log: LogGrown, _: Moment, __: Do) -> Situation:
    """Note the size of the log in progress."""
    return _with(now, replace(current, size=log.size))


def measured(now: Situation, current: RecordingInProgress, _: RecorderHealth, __: Moment, do: Do) -> Situation:
    """Look once a second how large the log is."""
    if not current.opening:
        do(MeasureLog(current.path))
    return now


def started(now: Situation, current: RecordingInProgress, report: RecordingStarted, at: Moment, do: Do) -> Situation:
    """The log is open; or, if it goes on after the death of a recorder, another one."""
    if current.interruption is not None:
        do(LogOpened(current.order.path))
        now = _with(now, current.continued_in(current.order.path))
        now = replace(now, recordings=replace(now.recordings, armed_at=at.s))
        return move(now, State.RECORDING, at, do)
    begun = current.begun(report)
    do(LogOpened(begun.path))
    now = move(_with(now, begun), State.RECORDING, at, do)
    do(Say(Level.INFO, "service", phrase("event_started", "recording {recording} started", recording=begun.id)))
    if current.opened is not None:
        do(Answer(current.opened, begun.view(at.utc)))
    return now


def continued(now: Situation, current: RecordingInProgress, report: RecordingContinued, _: Moment, do: Do) -> Situation:
    """The log failed, or is as large as a part may be, and the recorder goes on in another one."""
    do(LogOpened(report.path, part=report.before.failure is None))
    if report.before.failure is None:
        return _with(now, current.in_next_part(report.path, report.before))
    notice = recording_continued(report.before.path.stem, report.path, report.before.failure)
    now = _with_notice(now, notice)
    return _with(now, current.continued_in(report.path))


def progressed(now: Situation, current: RecordingInProgress, report: RecordingProgress, _: Moment, do: Do) -> Situation:
    """Enter the account; and say what is missing where the recording went on, once its first pulse is there."""
    current = replace(current, account=current.account.progressed(report))
    before = current.order.goes_on
    if current.interruption is None or before is None or report.first_pulse is None:
        return _with(now, current)
    gap = next((pause for pause in report.pauses if pause.after_pulse == before.pulse), None)
    notice = recording_resumed(before.recording, current.id, gap)
    do(Say(Level.WARNING, "service", notice.said))
    return _with(_with_notice(now, notice), replace(current, interruption=None))


def finished(now: Situation, current: RecordingInProgress, report: RecordingFinished, at: Moment, do: Do) -> Situation:
    """The log is closed."""
    now = progressed(now, current, report, at, do)
    current = now.recordings.current or current
    total = current.account.counts
    text = "recording {recording} stopped: {pulses} pulses, {complete} complete, {partial} partial"
    said = phrase(
        "event_stopped", text,
        recording=current.id, pulses=total.pulses, complete=total.complete, partial=total.partial,
    )  # fmt: skip
    do(Say(Level.INFO, "service", said))
    if report.failure is not None:
        notice = recording_ended(current.id, report.failure.error())
        do(Say(Level.ERROR, "service", notice.said))
        now = _with_notice(now, notice)
    elif current.longest_s is not None and not current.stopping:
        notice = recording_forgotten(current.id, current.longest_s)
        do(Say(Level.WARNING, "service", notice.said))
        now = _with_notice(now, notice)
    return _over(now, current, report, State.ARMED, at, do)


def refused(now: Situation, current: RecordingInProgress, report: RecorderFailed, at: Moment, do: Do) -> Situation:
    """The recorder cannot open a log, or go on."""
    error = report.error()
    if current.opening and isinstance(error, NameTakenError):
        if now.seen.processes is not Processes.NONE:
            do(NameLog(current.wanted))
        return now
    return fail(now, error, State.ARMED if current.interruption is None else now.state, at, do)


def interrupt(now: Situation, error: SvevError, at: Moment, do: Do) -> tuple[Situation, SvevError | None]:
    """Begin to continue the recording in progress, because its recorder died.

    Returns:
        The situation; and None if it goes on as soon as there is a new recorder (`go_on`), otherwise the error that
        ends it.
    """
    current = now.recordings.current
    if current is None or current.opening or current.stopping:
        return now, error
    current = replace(current, deaths=(*current.deaths, at.s))
    if died_too_often(current.deaths, at.s):
        text = "the recorder ended {times} times within {seconds:g} s, so the recording is not continued again; {why}"
        said = phrase("why_died_often", text, times=DEATHS_MAX, seconds=DEATHS_WITHIN_S, why=error.said)
        return _with(now, current), ProcessDiedError(said)
    do(ReadLog(current.path, current.ids[0]))
    return _with(now, replace(current, interruption=Interruption(error, at.s + LOG_READ_S))), None


def read(now: Situation, current: RecordingInProgress, news: LogRead, _: Moment, __: Do) -> Situation:
    """Note what the log of a dead recorder holds."""
    if current.interruption is None or current.path != news.log:
        return now
    return _with(now, replace(current, interruption=replace(current.interruption, read=True, found=news.found)))


def may_restart(now: Situation, at: Moment) -> bool:
    """Whether a new recorder may be started: not before it is known with which pulse a recording goes on."""
    current = now.recordings.current
    return current is None or current.interruption is None or current.interruption.over(at.s)


def go_on(now: Situation, at: Moment, do: Do) -> Situation:
    """Have a new recorder continue the recording that the death of the last one interrupted, if there is one."""
    current = now.recordings.current
    if current is None or current.interruption is None:
        return now
    found, seconds = current.interruption.found, current.order.seconds
    late = seconds is not None and at.host > current.commanded + round(seconds * NS_PER_S)
    if found is None or late:
        return fail(now, current.interruption.error, now.state, at, do)
    order = going_on(current.order, current.session, found, current.commanded, now.in_use.rig.trigger.period_ns)
    do(Order(order))
    return _with(now, current.gone_on(order, found.log.ledger.counts()))


def fail(now: Situation, error: SvevError, then: State, at: Moment, do: Do) -> Situation:
    """End the recording in progress, if there is one, with an error, and go to the state `then`."""
    current = now.recordings.current
    if current is None:
        return now
    if current.opened is not None:
        do(GiveBack(current.id))
        do(Refuse(current.opened, error))
        return _with(now, None)
    notice = recording_ended(current.id, error)
    do(Say(Level.ERROR, "service", notice.said))
    return _over(_with_notice(now, notice), current, error, then, at, do)


def abandoned(now: Situation, current: RecordingInProgress, _: ProcessesEnded, __: Moment, do: Do) -> Situation:
    """Answer all who wait, because the service ends before the recorder's last report."""
    text = "the service ends: look at the list of recordings when it runs again"
    error = ProcessDiedError(phrase("why_service_ends", text))
    if current.opened is not None:
        do(Refuse(current.opened, error))
    for waiting in current.waiting:
        do(Answer(waiting, error))
    return _with(now, None)


def _with(now: Situation, current: RecordingInProgress | None) -> Situation:
    return replace(now, recordings=replace(now.recordings, current=current))


def _with_notice(now: Situation, notice: Statement) -> Situation:
    return replace(now, recordings=replace(now.recordings, notice=notice))


def _check_armed(now: Situation) -> None:
    if now.seen.processes is Processes.NONE or now.state is not State.ARMED or now.recordings.current is not None:
        raise StateForbidsError(FORBIDDEN["start", State.RECORDING if now.state is State.ARMED else now.state])


def _fitting(in_use: RigInUse) -> Calibration | None:
    """The calibration without cameras that were calibrated with another region."""
    if (known := in_use.calibration) is None:
        return None
    unfit = {camera.name for camera in in_use.rig.cameras if camera.calibrated_region is not None}
    cameras = {name: data for name, data in known.cameras.items() if name not in unfit}
    return msgspec.structs.replace(known, cameras=cameras)


def _reach_s(now: Situation, order: RecordingOrder, at: Moment) -> float:
    """How far a recording begins in the past: not before the rig was armed, when cameras were missing."""
    armed_s = at.s - now.recordings.armed_at
    return armed_s if order.preroll_s is None else min(order.preroll_s, armed_s)


def _over(now: Situation, current: RecordingInProgress, outcome: Outcome, then: State, at: Moment, do: Do) -> Situation:
    parts = outcome.earlier if isinstance(outcome, RecordingFinished) else ()
    do(LogsClosed(tuple(part.path for part in parts if not part.closed)))
    emptied_at = now.recordings.armed_at if current.mishap else at.s
    now = replace(now, recordings=replace(now.recordings, current=None, last=current.id, emptied_at=emptied_at))
    if then is not now.state:
        now = move(now, then, at, do)
    for waiting in current.waiting:
        do(Answer(waiting, outcome))
    return now
