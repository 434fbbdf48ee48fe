"""State x message: what the supervisor does with commands and with what happens to the rig, without any process."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import pytest

from rig.api.recordings import Recording, RecordingOrder, StopOrder
from rig.api.status import State
from rig.errors import BadInputError, StateForbidsError, StorageError, UnknownAlarmError
from rig.phrase import phrase
from rig.transport.recorder_commands import RecorderOptions, StartRecording, StopRecording
from rig.transport.recorder_reports import CameraNews
from service.status.event_hub import EventHub
from service.supervision.messages import Acknowledge, Arm, Command, Disarm, Start, Stop
from service.supervision.supervisor import Supervisor
from tests.service.supervision.processes_in_memory import ProcessesInMemory
from tests.support.rigs import SIM
from tests.support.waiting import wait_until

T = TypeVar("T")
IDLE, ARMING, ARMED, RECORDING, FAULT = State.IDLE, State.ARMING, State.ARMED, State.RECORDING, State.FAULT


class Bench:
    """A supervisor whose loop the test turns by hand.

    Attributes:
        supervisor: it.
        moves: the states that it has had.
        opened: answered when the log of the last recording is open.
    """

    def __init__(self, folder: Path, *, enduring: bool = True) -> None:
        self.moves: list[State] = [IDLE]
        options, hub = RecorderOptions(directory=folder), EventHub(lambda _: None)
        self.supervisor = Supervisor(SIM, "", hub, options, hill=lambda _: nullcontext({}), enduring=enduring)
        self.opened: Future[Recording] = Future()

    @property
    def rig(self) -> ProcessesInMemory:
        """The processes."""
        return ProcessesInMemory.latest

    def turn(self) -> State:
        """One turn of the loop, and the state after it."""
        self.supervisor._turn()
        state = self.supervisor.status.state
        if state is not self.moves[-1]:
            self.moves.append(state)
        return state

    def until(self, state: State) -> None:
        """Turn until this state is reached."""
        wait_until(lambda: self.turn() is state, f"state {state}; so far {self.moves}", poll_s=0.001)

    def ask(self, make: "Callable[[Future[T]], Command[T]]") -> "Future[T]":
        """Give a command; raises why it is refused."""
        answer: Future[T] = Future()
        self.supervisor._obey(make(answer))
        self.supervisor._show()
        if answer.done():
            answer.result(0)
        return answer

    def close(self) -> None:
        """Stop what it has begun."""
        self.supervisor._world.close()
        self.supervisor._world.end()
        self.supervisor._commands.end()
        self.supervisor._commands.close()

    def arm(self) -> None:
        """Arm."""
        self.ask(Arm)

    def disarm(self) -> None:
        """Disarm."""
        self.ask(Disarm)

    def start(self) -> None:
        """Order a recording."""
        self.opened = self.ask(partial(Start, order=RecordingOrder()))

    def stop(self) -> None:
        """Stop it, as somebody who is sure."""
        current = self.supervisor.now.recordings.current
        assert current is not None
        self.ask(partial(Stop, recording=current.id, order=StopOrder(confirm=True)))

    def one_camera_goes(self) -> None:
        """K1 is gone."""
        self.rig.camera(0, CameraNews.GONE)

    def all_cameras_go(self) -> None:
        """All are gone."""
        for index in range(len(SIM.cameras)):
            self.rig.camera(index, CameraNews.GONE)

    def all_cameras_come(self) -> None:
        """All are there."""
        for index in range(len(SIM.cameras)):
            self.rig.camera(index, CameraNews.CONNECTED)

    def recorder_dies(self) -> None:
        """The recorder is killed."""
        self.rig.die()


Act = Callable[[Bench], None]
_READY: tuple[tuple[Act, State], ...] = ((Bench.arm, ARMED),)
_RUNNING = (*_READY, (Bench.start, RECORDING))
#: What happens, and the state to which it leads.
STORIES: dict[str, tuple[tuple[Act, State], ...]] = {
    "armed and disarmed": (*_READY, (Bench.disarm, IDLE)),
    "armed twice": (*_READY, (Bench.arm, ARMED)),
    "disarmed when idle": ((Bench.disarm, IDLE),),
    "disarmed while arming": ((Bench.arm, ARMING), (Bench.disarm, IDLE)),
    "two recordings": (*_RUNNING, (Bench.stop, ARMED), (Bench.start, RECORDING), (Bench.stop, ARMED)),
    "one camera goes": (*_READY, (Bench.one_camera_goes, ARMED)),
    "all cameras go and come back": (*_READY, (Bench.all_cameras_go, FAULT), (Bench.all_cameras_come, ARMED)),
    "all cameras go while recording": (*_RUNNING, (Bench.all_cameras_go, RECORDING), (Bench.stop, FAULT)),
    "disarmed in a fault": (*_READY, (Bench.all_cameras_go, FAULT), (Bench.disarm, IDLE)),
    "armed in a fault, with all anew": (*_READY, (Bench.all_cameras_go, FAULT), (Bench.arm, ARMED)),
    "the recorder dies": (*_READY, (Bench.recorder_dies, FAULT), (Bench.arm, ARMED)),
}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr("service.processes.rig_session.RigProcesses", ProcessesInMemory)
    monkeypatch.setattr("service.processes.rig_session.prepare_programs", lambda _: None)
    made = Bench(tmp_path)
    yield made
    made.close()


@pytest.mark.usefixtures("bench")
def test_who_does_not_endure_ends_at_once_with_the_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ProcessesInMemory, "fails", BadInputError("the address is in use: choose another one"))
    other = Bench(tmp_path, enduring=False)

    def ended() -> bool:
        other.turn()
        return other.supervisor._over()

    other.arm()
    wait_until(ended, "it ends", poll_s=0.001)
    assert str(other.supervisor.now.loop.failure) == "the address is in use: choose another one"
    assert other.moves == [IDLE, ARMING], "it is not disarmed first"
    other.close()


@pytest.mark.parametrize("story", STORIES.values(), ids=STORIES)
def test_what_happens_leads_to_this_state(bench: Bench, story: tuple[tuple[Act, State], ...]) -> None:
    for act, state in story:
        act(bench)
        if state is not ARMING:
            bench.until(state)
    for _ in range(3):
        assert bench.turn() is story[-1][1], "and it stays so"


def test_what_no_state_allows_is_refused_and_changes_nothing(bench: Bench) -> None:
    refused: dict[State, tuple[Act, ...]] = {
        IDLE: (Bench.start,),
        ARMED: (),
        RECORDING: (Bench.start, Bench.disarm),
        FAULT: (Bench.start,),
    }
    ways: dict[State, tuple[tuple[Act, State], ...]] = {
        IDLE: (), ARMED: _READY, RECORDING: ((Bench.start, RECORDING),),
        FAULT: ((Bench.stop, ARMED), (Bench.all_cameras_go, FAULT)),
    }  # fmt: skip
    for state, acts in refused.items():
        for act, reached in ways[state]:
            act(bench)
            bench.until(reached)
        for forbidden in acts:
            with pytest.raises(StateForbidsError):
                forbidden(bench)
            assert bench.turn() is state


def test_a_recording_is_opened_and_closed_once_and_the_one_who_waits_is_answered(bench: Bench) -> None:
    bench.arm()
    bench.until(ARMED)
    bench.start()
    with pytest.raises(StateForbidsError):
        bench.start()  # a second tap before the log is open
    bench.until(RECORDING)
    assert bench.opened.result(0).id == bench.supervisor.status.recording.id  # type: ignore[union-attr]
    bench.stop()
    bench.stop()
    bench.until(ARMED)
    told = [type(command) for command in bench.rig.commands if isinstance(command, StartRecording | StopRecording)]
    assert told == [StartRecording, StopRecording]


def test_a_log_that_cannot_be_opened_leaves_the_rig_armed_and_says_why(bench: Bench) -> None:
    bench.arm()
    bench.until(ARMED)
    bench.rig.disk_full = True
    bench.start()
    wait_until(lambda: bench.turn() is ARMED and bench.opened.done(), "the one who waits is answered")
    assert isinstance(bench.opened.exception(), StorageError)
    bench.rig.disk_full = False
    bench.start()
    bench.until(RECORDING)


def test_a_rig_that_cannot_be_set_up_is_a_fault_and_the_next_tap_tries_at_once(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ProcessesInMemory, "fails", BadInputError("the address is in use: choose another one"))
    bench.arm()
    bench.until(FAULT)
    fault = bench.supervisor.status.statement
    assert "the address is in use" in fault.text
    monkeypatch.setattr(ProcessesInMemory, "fails", None)
    bench.arm()
    bench.until(ARMED)


def test_that_jumps_cannot_be_measured_is_an_alarm_until_they_can(bench: Bench) -> None:
    def alarms() -> list[str]:
        bench.turn()
        return [alarm.statement.text for alarm in bench.supervisor.status.alarms]

    refused = phrase("why_no_file", "{path}: there is no such file", path="balls.jsn")
    said = "jumps are recorded, but not measured: balls.jsn: there is no such file"
    bench.arm()
    bench.until(ARMED)
    assert alarms() == []
    bench.rig.measuring(refused)
    assert alarms() == [said]
    assert bench.supervisor.status.statement.code == "alarm_not_measured"
    first = bench.supervisor.status.alarms
    bench.rig.measuring(refused)  # the process was killed, and its successor finds the same
    bench.turn()
    assert bench.supervisor.status.alarms == first
    bench.ask(partial(Acknowledge, alarm=first[0].number))
    assert bench.supervisor.status.alarms == (first[0].model_copy(update={"acknowledged": True}),)
    with pytest.raises(UnknownAlarmError, match="there is no alarm 99 any more"):
        bench.ask(partial(Acknowledge, alarm=99))
    bench.recorder_dies()
    bench.until(FAULT)
    assert alarms() == [said], "the recorder's death does not mend it"
    bench.rig.measuring(None)
    assert alarms() == []
    bench.rig.measuring(refused)
    assert alarms() == [said]
    assert not bench.supervisor.status.alarms[0].acknowledged, "it came anew"
    bench.disarm()
    bench.until(IDLE)
    assert alarms() == []


def test_after_a_fault_the_supervisor_tries_again_by_itself(bench: Bench) -> None:
    bench.arm()
    bench.until(ARMED)
    bench.recorder_dies()
    bench.until(FAULT)
    now = bench.supervisor.now
    assert now.fault.again_at > time.monotonic(), "not at once: it might die again and again"
    bench.supervisor.now = replace(now, fault=replace(now.fault, again_at=0.0))  # the seconds have passed
    bench.until(ARMED)
