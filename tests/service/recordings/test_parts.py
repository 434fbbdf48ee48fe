"""The service's small parts: back-off, event hub, commands, pulse rate, log lines, room."""

import threading
from collections.abc import Callable
from functools import partial
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import UtcNs
from rig.errors import ProcessDiedError, StorageError
from rig.events import Event, Level
from rig.transport.process_table import BackOff
from service.recordings.storage import check_room_for, room_for
from service.status.event_hub import EventHub
from service.supervision.commands import Commands
from service.supervision.messages import Burst
from service.supervision.situation import PulseRate
from svev.serving.systemd import log_line
from tests.support.rigs import SIM


def test_back_off_doubles_to_half_a_minute_and_forgets_after_a_good_one() -> None:
    deaths = list(accumulate([5.0] * 7, BackOff.died, initial=BackOff()))
    assert [back_off.wait_s for back_off in deaths] == [0, 1, 2, 4, 8, 16, 30, 30]
    good = deaths[-1].died(61.0)
    assert (good.wait_s, good.died(1.0).wait_s, good.died(1.0).forgotten().died(1.0)) == (1, 2, BackOff(10, 1.0))


def _event(message: str = "hello", level: Level = Level.INFO) -> Event:
    return Event(UtcNs(1_795_216_434_399_239_000), level, "K2", message)


def test_events_are_numbered_kept_and_told() -> None:
    lines: list[Event] = []
    hub = EventHub(lines.append)
    woken: list[int] = []
    end = hub.listen(lambda: woken.append(len(hub.after(0))))
    for number in range(1200):
        hub.tell(_event(str(number)))
    assert len(lines) == 1200
    assert [event.number for event in hub.after(0)] == list(range(201, 1201)), "the last thousand are kept"
    assert [event.message for event in hub.after(1198)] == ["1198", "1199"]
    assert len(woken) == 1200
    end()
    hub.wake()
    assert len(woken) == 1200


def test_a_listener_may_leave_while_it_is_woken() -> None:
    hub = EventHub(lambda _: None)
    ends: list[Callable[[], None]] = []

    def leave() -> None:
        ends[0]()

    ends.append(hub.listen(leave))
    hub.tell(_event())
    hub.tell(_event())
    assert len(hub.after(0)) == 2


def test_log_lines_are_one_line_each() -> None:
    event = _event("lost\nfor good", Level.ERROR)
    assert log_line(event, journal=True) == "<3>K2: lost\\nfor good"
    assert log_line(event, journal=False).endswith(" error   K2: lost\\nfor good")
    assert [log_line(_event(level=level), journal=True)[:3] for level in Level] == ["<7>", "<6>", "<4>", "<3>", "<2>"]


@given(st.lists(st.integers(0, 40), min_size=2, max_size=20))
def test_the_rate_of_pulses_is_what_came_in_the_last_second(steps: list[int]) -> None:
    rate, total = PulseRate(), 0
    for second, step in enumerate(steps):
        total += step
        rate = rate.counted(total, float(second))
    assert rate.rate_hz == steps[-1]
    assert rate.arriving == (steps[-1] > 0)


def test_a_report_that_is_late_says_nothing_of_the_rate() -> None:
    rate = PulseRate().counted(0, 0.0).counted(300, 10.0)
    assert rate.rate_hz is None
    assert rate.arriving


@given(st.integers(0, 10**13))
def test_room_is_never_negative_and_jumps_fit_into_it(free: int) -> None:
    room = room_for(SIM, free)
    jump_s = SIM.recorder.jump_s
    assert 0 <= room.jumps * jump_s <= room.seconds < (room.jumps + 1) * jump_s + 1e-6
    assert (room.seconds == 0) == (free <= SIM.recorder.reserve_gb * 1e9)


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    check_room_for(SIM, tmp_path, 0.0)
    with pytest.raises(StorageError, match=r"there is room for .* delete recordings"):
        check_room_for(SIM, tmp_path, 1e9)
    with pytest.raises(StorageError, match="there is room for 0 s"):
        check_room_for(SIM, tmp_path / "unplugged", 1.0)


def test_commands_are_answered_by_their_owner_in_order() -> None:
    commands, done, over = Commands(), list[int](), threading.Event()

    def own() -> None:
        while not over.is_set():
            for message in commands.fetch():
                assert isinstance(message, Burst)
                done.append(message.pulses)
                if message.pulses < 50:
                    message.answer.set_result(None)

    owner = threading.Thread(target=own)
    owner.start()
    for number in range(50):
        commands.ask(partial(Burst, pulses=number), 10.0)
    assert done == list(range(50))
    with pytest.raises(ProcessDiedError, match="did not get it done within 0"):
        commands.ask(partial(Burst, pulses=50), 0.01)
    over.set()
    owner.join(10)
    commands.end_by(0.0)
    commands.end()
    with pytest.raises(ProcessDiedError, match="is ending"):
        commands.ask(partial(Burst, pulses=51), 10.0)
    commands.close()
