"""State x message: what follows from every command in every state, and from each accident; nothing runs."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import Any, get_args

import pytest

from rig.api.recordings import Counts, RecordingOrder, SessionChange, SessionFields, StopOrder
from rig.api.status import State
from rig.errors import (
    BadInputError,
    ChangedMeanwhileError,
    ConfirmFirstError,
    NameTakenError,
    ProcessDiedError,
    StateForbidsError,
    StorageError,
    TooSoonError,
    UnknownRecordingError,
)
from rig.events import Level
from rig.phrase import phrase
from rig.settings.camera import Region
from rig.transport.recorder_commands import StopRecording
from rig.transport.recorder_reports import (
    RecorderFailed,
    RecordingFinished,
    RecordingStarted,
)
from service.processes.seen import CameraPresence, Processes, Seen
from service.recordings.in_progress import RecordingInProgress
from service.supervision import messages as m
from service.supervision.decide import DECISIONS, DECISIONS_IN_A_RECORDING, is_over
from service.supervision.situation import RigInUse, Situation
from tests.service.supervision.situations import AT, GONE, HERE, LOG, RUNNING, SEEN, later, recording, situation, told
from tests.support.rigs import SIM

IDLE, ARMING, ARMED, RECORDING, DISARMING, FAULT = (
    State.IDLE, State.ARMING, State.ARMED, State.RECORDING, State.DISARMING, State.FAULT,
)  # fmt: skip
_FIRST = SIM.cameras[0].model_copy(update={"region": Region(width=320, height=240)})
_OTHER = RigInUse(SIM.model_copy(update={"cameras": (_FIRST, *SIM.cameras[1:])}), "other")
DIED = ProcessDiedError(phrase("why_died", "the recorder died"))
REFUSED = None
#: What each command leads to, from each state; `REFUSED`: nothing, and who gave it is told why.
COMMANDS: dict[str, tuple[Callable[..., m.Command[Any]], tuple[State | None, ...]]] = {
    #                                                       idle     arming   armed    recording  disarming  fault
    "arm": (m.Arm,                                          (ARMING, ARMING,  ARMED,   RECORDING, REFUSED,   ARMING)),
    "disarm": (m.Disarm,                                    (IDLE,   ARMING,  ARMED,   REFUSED,   DISARMING, FAULT)),
    "start": (partial(m.Start, order=RecordingOrder()),     (REFUSED, REFUSED, ARMED,  REFUSED,   REFUSED,   REFUSED)),
    "stop": (partial(m.Stop, recording="one", order=StopOrder()),
                                                            (REFUSED, REFUSED, REFUSED, RECORDING, REFUSED,  REFUSED)),
    "close": (m.Close,                                      (REFUSED, REFUSED, REFUSED, RECORDING, REFUSED,  REFUSED)),
    "session": (partial(m.ChangeSession, recording="one", change=SessionChange(bib="5")),
                                                            (IDLE,   ARMING,  ARMED,   RECORDING, DISARMING, FAULT)),
    "train": (partial(m.RunTrain, running=False),           (REFUSED, REFUSED, ARMED,  REFUSED,   REFUSED,   REFUSED)),
    "burst": (partial(m.Burst, pulses=3),                   (REFUSED, REFUSED, REFUSED, REFUSED,  REFUSED,   REFUSED)),
    "light": (partial(m.ChangeCamera, new=_OTHER, camera="K1"),
                                                            (IDLE,   ARMING,  ARMED,   REFUSED,   REFUSED,   FAULT)),
    "lens": (partial(m.ChangeCalibration, new=_OTHER),      (IDLE,   REFUSED, ARMED,   REFUSED,   REFUSED,   FAULT)),
    "rate": (partial(m.ChangeRate, new=_OTHER),             (IDLE,   REFUSED, ARMING,  REFUSED,   REFUSED,   ARMING)),
    "region": (partial(m.ChangeRegion, new=_OTHER, camera="K1"),
                                                            (IDLE,   REFUSED, ARMING,  REFUSED,   REFUSED,   ARMING)),
}  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("state", State)
def test_every_command_in_every_state(name: str, state: State) -> None:
    make, leads = COMMANDS[name]
    to = dict(zip((IDLE, ARMING, ARMED, RECORDING, DISARMING, FAULT), leads, strict=True))[state]
    now, command = situation(state), make(Future())
    if to is REFUSED:
        with pytest.raises((StateForbidsError, UnknownRecordingError)):
            told(now, command)
        return
    after, effects = told(now, command)
    assert after.state is to
    answered = [each for each in effects if isinstance(each, m.Answer | m.AnswerStatus) and each.to is command.answer]
    later_on = name in {"start", "stop"} or (name, state) == ("region", ARMED)
    assert len(answered) == (0 if later_on else 1), "who waits is answered once, now or when it is done"


def test_every_message_has_its_place_in_the_tables() -> None:
    known = DECISIONS.keys() | DECISIONS_IN_A_RECORDING.keys()
    assert len(m.Command.__subclasses__()) > 10
    assert {*m.Command.__subclasses__(), *get_args(m.Happening)} <= known


def _kinds(effects: list[m.Effect]) -> list[type]:
    return [type(effect) for effect in effects]


def _said(effects: list[m.Effect]) -> list[str]:
    return [effect.said.code for effect in effects if isinstance(effect, m.Say)]


def _with(now: Situation, current: RecordingInProgress | None) -> Situation:
    return replace(now, recordings=replace(now.recordings, current=current))


def _died(now: Situation) -> Situation:
    """What is seen when the recorder is dead."""
    nobody = (CameraPresence(),) * len(SIM.cameras)
    return replace(now, seen=replace(now.seen, processes=Processes.NO_RECORDER, cameras=nobody, warm=False))


def _finished(*, stopped_by_disk: bool = False) -> RecordingFinished:
    failure = RecorderFailed.of(StorageError("the disk is full")) if stopped_by_disk else None
    counts = Counts(pulses=9, complete=8, partial=1)
    return RecordingFinished(
        path=LOG, bytes=1, unpublished=0, counts=counts, first_pulse=None, pauses=(), failure=failure
    )


@pytest.mark.parametrize(
    ("seen", "opening", "error"),
    [(6, False, ChangedMeanwhileError), (7, True, ChangedMeanwhileError), (7, False, TooSoonError)],
)
def test_a_second_tap_on_record_is_no_wish(seen: int, opening: bool, error: type[Exception]) -> None:
    now = situation(ARMED)
    now = replace(now, phase=replace(now.phase, number=7, began=AT.s - 0.5))
    now = _with(now, recording(opened=False) if opening else None)
    with pytest.raises(error):
        told(now, m.Start(Future(), RecordingOrder(seen=seen)))


def test_a_recording_that_has_just_begun_is_stopped_only_by_who_is_sure_and_its_jumper_waits_again() -> None:
    now = situation(RECORDING)
    now = replace(now, phase=replace(now.phase, number=7, began=AT.s - 2.0))
    with pytest.raises(ConfirmFirstError):
        told(now, m.Stop(Future(), "one", StopOrder(seen=7)))
    with pytest.raises(ChangedMeanwhileError):
        told(now, m.Stop(Future(), "one", StopOrder(seen=6, confirm=True)))
    after, effects = told(now, m.Stop(Future(), "one", StopOrder(seen=7, confirm=True)))
    assert effects == [m.GiveBack("one"), m.Order(StopRecording(at_once=False, keep=True))]
    ended, _ = told(after, _finished(), at=later(1))
    assert ended.recordings.emptied_at == ended.recordings.armed_at, "memory has what the mishap recorded"
    _, effects = told(after, m.Stop(Future(), "one", StopOrder(seen=7)))
    assert effects == [], "whoever stops once more only waits"


def test_a_recording_is_started_and_ended() -> None:
    opened: Future[Any] = Future()
    now, effects = told(situation(ARMED), command := m.Start(opened, RecordingOrder(duration_s=2.0)))
    assert effects == [m.PrepareLog(command)]
    now, effects = told(now, m.LogPrepared(command, LOG, SessionFields(bib="5"), {"class": "J18"}))
    order = effects[0].command  # type: ignore[union-attr]
    assert (order.path, order.seconds, order.nobody_stops) == (LOG, 2.0, False)  # type: ignore[union-attr]
    assert (order.session, order.rig_toml) == ({"class": "J18", "bib": "5"}, "name = 'sim'")  # type: ignore[union-attr]
    with pytest.raises(StateForbidsError):
        told(now, m.Start(Future(), RecordingOrder()))
    now, effects = told(now, RecordingStarted(first_pulse=None))
    assert (now.state, _kinds(effects)) == (RECORDING, [m.LogOpened, m.Say, m.Say, m.Answer])
    assert effects[-1].to is opened  # type: ignore[union-attr]
    stopped: Future[Any] = Future()
    now, _ = told(now, m.Stop(stopped, "one", StopOrder()))
    now, effects = told(now, end := _finished())
    assert (now.state, now.recordings.last, now.recordings.notice) == (ARMED, "one", None)
    assert effects[-1] == m.Answer(stopped, end)


@pytest.mark.parametrize(("stopped", "notice"), [(False, "recording_forgotten"), (True, None)])
def test_a_recording_that_nobody_stopped_is_called_forgotten(stopped: bool, notice: str | None) -> None:
    now = _with(situation(RECORDING), replace(recording(), stopping=stopped))
    now, _ = told(now, _finished())
    said = now.recordings.notice
    assert (None if said is None else said.code) == notice


def test_a_recording_that_the_disk_ended_says_so() -> None:
    now, effects = told(situation(RECORDING), _finished(stopped_by_disk=True))
    assert now.recordings.notice is not None
    assert (now.state, now.recordings.notice.code) == (ARMED, "recording_ended")
    assert [effect.level for effect in effects if isinstance(effect, m.Say)][-2:] == [Level.ERROR, Level.INFO]


def test_a_name_that_another_program_has_taken_is_followed_by_the_next_one() -> None:
    now = _with(situation(ARMED), recording(opened=False))
    _, effects = told(now, RecorderFailed.of(NameTakenError("it is there")))
    assert effects == [m.NameLog(LOG)]
    other = LOG.with_name("one-2.mcap")
    now, effects = told(now, m.LogNamed(other))
    assert now.recordings.current is not None
    assert (effects[0], now.recordings.current.id) == (m.RenameTaken("one", "one-2"), "one-2")
    assert effects[1] == m.Order(now.recordings.current.order)


def test_a_log_that_cannot_be_opened_costs_no_jumper() -> None:
    current = recording(opened=False)
    now, effects = told(_with(situation(ARMED), current), RecorderFailed.of(StorageError("no room")))
    assert (now.state, now.recordings.current) == (ARMED, None)
    assert (effects[0], effects[1].to) == (m.GiveBack("one"), current.opened)  # type: ignore[union-attr]


def test_the_recorder_that_dies_between_recordings_is_a_fault_and_started_again_after_a_while() -> None:
    now, effects = told(_died(situation(ARMED)), m.RigFailed(DIED))
    assert (now.state, now.fault.again_at, _said(effects)[-1]) == (FAULT, AT.s + 1, "event_starting_again")
    waiting, effects = told(now, m.TurnBegins(), at=later(0.5))
    assert (waiting.state, effects) == (FAULT, [])
    again, effects = told(now, m.TurnBegins(), at=later(1.5))
    assert (again.state, _kinds(effects)) == (ARMING, [m.Say, m.RestartRecorder])
    at_once, effects = told(now, m.Arm(Future()), m.TurnBegins())
    assert (at_once.state, _kinds(effects)[-1]) == (ARMING, m.RestartRecorder), "a tap does not wait"


def test_a_recording_whose_recorder_died_waits_for_its_log_and_ends_if_that_cannot_be_read() -> None:
    stopped: Future[Any] = Future()
    now = _with(situation(RECORDING), replace(recording(), waiting=(stopped,)))
    now, effects = told(_died(now), m.RigFailed(DIED))
    assert (now.state, now.fault.again_at) == (FAULT, AT.s)
    assert m.ReadLog(LOG, "one") in effects
    assert told(now, m.TurnBegins(), at=later(5))[1] == [], "not before it is known where it goes on"
    hanging, _ = told(now, m.TurnBegins(), at=later(11))
    assert hanging.state is ARMING
    now, effects = told(now, m.LogRead(LOG, None), m.TurnBegins())
    assert m.RestartRecorder() in effects
    assert (now.recordings.current, effects[-1]) == (None, m.Answer(stopped, DIED))
    assert now.recordings.notice is not None
    assert now.recordings.notice.code == "recording_ended"


def test_a_recorder_that_dies_again_and_again_ends_the_recording() -> None:
    now = situation(RECORDING)
    for seconds in (0, 10):
        now, effects = told(_died(now), m.RigFailed(DIED), at=later(seconds))
        assert any(isinstance(effect, m.ReadLog) for effect in effects)
        current = now.recordings.current
        assert current is not None
        now = _with(situation(RECORDING), replace(current, interruption=None))  # it goes on
    once = told(_died(now), m.RigFailed(DIED), at=later(61))[0]
    assert once.recordings.current is not None, "the first death is more than a minute ago"
    died = ProcessDiedError("the recorder process ended (killed by SIGKILL): if it recurs, run `svev doctor`")
    now, effects = told(_died(now), m.RigFailed(died), at=later(20))
    assert (now.state, now.recordings.current) == (FAULT, None)
    assert not any(isinstance(effect, m.ReadLog) for effect in effects)
    assert now.recordings.notice is not None
    assert "3 times within 60 s" in now.recordings.notice.text


def test_a_service_that_does_not_endure_ends_with_the_error_that_says_most() -> None:
    now = situation(ARMING)
    now = replace(now, loop=replace(now.loop, enduring=False))
    complaint = BadInputError("the address is in use: choose another one")
    now, _ = told(now, RecorderFailed.of(complaint), m.RigFailed(DIED))
    assert str(now.loop.failure) == str(complaint)
    assert is_over(now, AT)


def _all(presence: CameraPresence, **more: Any) -> Seen:
    return replace(RUNNING, cameras=(presence,) * len(SIM.cameras), **more)


#: What is seen, and the state to which it leads; one story each.
CAMERAS: dict[str, tuple[tuple[State, Seen, State], ...]] = {
    "all answer": ((ARMING, RUNNING, ARMED),),
    "none has answered yet": ((ARMING, SEEN[ARMING], ARMING),),
    "all have failed": ((ARMING, SEEN[FAULT], FAULT), (FAULT, RUNNING, ARMED)),
    "all go while armed": ((ARMED, _all(GONE), FAULT), (FAULT, RUNNING, ARMED)),
    "one goes while armed": ((ARMED, replace(RUNNING, cameras=(GONE, HERE, HERE)), ARMED),),
    "all go while recording": ((RECORDING, _all(GONE), RECORDING),),
    "no triplet yet": ((ARMING, replace(RUNNING, warm=False), ARMING),),
    "the recorder has not started": ((ARMING, replace(RUNNING, ready=False), ARMING),),
}


@pytest.mark.parametrize("story", CAMERAS.values(), ids=CAMERAS)
def test_cameras_that_come_and_go(story: tuple[tuple[State, Seen, State], ...]) -> None:
    for before, seen, to in story:
        assert told(situation(before, seen=seen), m.TurnEnds())[0].state is to


def _two_of_three(state: State, *present: bool, least: int = 2) -> Situation:
    seen = replace(RUNNING, cameras=tuple(HERE if each else GONE for each in present))
    now = situation(state, seen=seen)
    return replace(now, goal=replace(now.goal, least_cameras=least))


def test_a_rig_that_loses_cameras_is_armed_again_when_enough_are_back() -> None:
    now, _ = told(_two_of_three(ARMED, True, True, False), m.Arm(Future(), min_cameras=1))
    assert now.goal.least_cameras == 2, "a late tap: while armed it changes nothing"
    now, _ = told(_two_of_three(ARMED, False, False, False), m.TurnEnds())
    assert now.state is FAULT
    now = replace(now, seen=_two_of_three(FAULT, False, True, False).seen)
    assert told(now, m.TurnEnds())[0].state is FAULT, "one is too few"
    anew, effects = told(now, m.Arm(Future()))
    assert (anew.state, _kinds(effects)[-1]) == (ARMING, m.TakeDown), "somebody has seen to it: tried anew at once"
    anew, _ = told(replace(anew, seen=now.seen), m.TurnBegins(), m.TurnEnds())
    assert anew.fault.statement is not None
    assert anew.fault.statement.text == "1 of 3 cameras answer, 2 are needed: without K1, K3"
    enough, _ = told(anew, m.Arm(Future(), min_cameras=1))
    assert enough.state is ARMED
    off, _ = told(enough, m.Disarm(Future()))
    assert off.goal.least_cameras == SIM.least_cameras, "once is not for ever"
    now, _ = told(_two_of_three(FAULT, True, True, False), m.TurnEnds())
    assert now.state is ARMED
    assert told(_two_of_three(ARMED, False, True, False), m.TurnEnds())[0].state is ARMED, "while a camera is left"


#: Why a region is given back: what is seen when arming is done, and the code of the reason.
REGIONS = {
    "taken": (RUNNING, None),
    "the camera refuses it": (replace(RUNNING, cameras=(GONE, HERE, HERE), warm=False), "event_region_refused"),
    "no triplets": (replace(RUNNING, warm=False), "event_region_refused"),
}


@pytest.mark.parametrize("what", REGIONS)
def test_a_region_is_tried_and_given_back_if_it_cannot_be_used(what: str) -> None:
    seen, code = REGIONS[what]
    answer: Future[None] = Future()
    before = situation(ARMED)
    now, effects = told(before, m.ChangeRegion(answer, _OTHER, "K1"))
    assert (now.state, now.in_use, effects[-1]) == (ARMING, _OTHER, m.TakeDown(keep_hill=True))
    now, _ = told(replace(now, seen=Seen(empty=False)), m.TurnBegins())
    now, effects = told(replace(now, seen=seen), m.TurnEnds())
    if what == "no triplets":
        assert (now.state, effects) == (ARMING, []), "a busy computer may be slow to begin"
        now, effects = told(now, m.TurnEnds(), at=later(11))
    assert now.trial is None
    if code is None:
        assert (now.state, now.in_use, effects[0]) == (ARMED, _OTHER, m.Answer(answer, None))
    else:
        assert (now.state, now.in_use, _said(effects)) == (ARMING, before.in_use, [code])
        assert [effect.to for effect in effects if isinstance(effect, m.Refuse)] == [answer]


@pytest.mark.parametrize("message", [m.Disarm(Future()), m.RigFailed(DIED), m.LoopEnds()])
def test_whatever_comes_between_gives_the_region_before_back(message: m.Message) -> None:
    answer: Future[None] = Future()
    before = situation(ARMED)
    now, _ = told(before, m.ChangeRegion(answer, _OTHER, "K1"))
    now, effects = told(now, message)
    assert (now.in_use, now.trial) == (before.in_use, None)
    assert [effect.to for effect in effects if isinstance(effect, m.Refuse)] == [answer]


@pytest.mark.parametrize(("duration_s", "starts"), [(None, True), (2.0, True), (0.0, False)])
def test_a_recording_starts_pulses_that_stand_still_but_not_one_of_the_past(
    duration_s: float | None, starts: bool
) -> None:
    now = situation(ARMED, seen=replace(RUNNING, still=True))
    command = m.Start(Future(), RecordingOrder(duration_s=duration_s))
    _, effects = told(now, m.LogPrepared(command, LOG, SessionFields(), {}))
    assert (m.LetPulses(None) in effects) is starts


def test_pulses_on_request_are_for_a_train_that_stands_still() -> None:
    still = situation(ARMED, seen=replace(RUNNING, still=True))
    assert told(still, m.Burst(Future(), 3))[1][0] == m.LetPulses(3)
    assert told(still, m.RunTrain(Future(), True))[1][1] == m.LetPulses(None)
    assert _kinds(told(still, m.RunTrain(Future(), False))[1]) == [m.Answer], "it is so already"


def test_a_recorder_that_says_nothing_is_ended_but_not_one_that_has_just_begun() -> None:
    now = situation(ARMED)
    assert told(now, m.TurnEnds(), at=later(19))[1] == []
    _, effects = told(now, m.TurnEnds(), at=later(21))
    assert _kinds(effects) == [m.Say, m.KillRecorder]
    fresh = replace(now, seen=replace(now.seen, started=AT.s + 5))
    assert told(fresh, m.TurnEnds(), at=later(21))[1] == []


def test_the_end_of_the_service_waits_for_a_recording_but_not_for_ever() -> None:
    now, _ = told(situation(RECORDING), m.End(AT.s + 4), m.End(AT.s + 400))
    assert not is_over(now, AT)
    now, effects = told(now, m.TurnBegins())
    assert effects == [m.Order(StopRecording(at_once=False, keep=False))]
    assert told(now, m.TurnBegins())[1] == []
    assert is_over(now, later(5)), "the disk may hang"
    assert is_over(told(now, _finished())[0], AT)
    assert is_over(told(situation(ARMED), m.End(AT.s + 4))[0], AT)


def test_whoever_waits_is_answered_when_the_service_ends() -> None:
    opened = recording(opened=False)
    waiting: Future[Any] = Future()
    _, effects = told(_with(situation(ARMED), replace(opened, waiting=(waiting,))), m.ProcessesEnded())
    assert [effect.to for effect in effects] == [opened.opened, waiting]  # type: ignore[union-attr]
