"""The driver of trigger boxes against an emulated one behind a pseudo-terminal, with the faults that real ones have."""

import random
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.clocks import HostNs, host_now
from rig.errors import BadInputError
from rig.events import Level
from rig.phrase import Phrase
from rig.settings.trigger import TriggerBoxTrigger
from simrig.triggerbox.box import BoxSettings, EmulatedBox
from simrig.triggerbox.timer import CrystalTimer
from tests.support.waiting import wait_until
from triggering.sources.choice import trigger_source
from triggering.sources.gate import Gate
from triggering.sources.triggerbox.clock import BoxClock, Reading
from triggering.sources.triggerbox.keeper import Fired, TrainKeeper
from triggering.sources.triggerbox.protocol import Answer, AnswerReader, crc8, encode, name_in, nearest_rate

US, MS = 1_000, 1_000_000
LONG_S = 60.0


@given(st.lists(st.one_of(st.binary(max_size=9), st.integers(0, 2**32 - 1))), st.integers(1, 7))
def test_answers_are_found_whatever_else_is_on_the_line(line: list[bytes | int], piece: int) -> None:
    answers = [Answer("P", count % 256, count, count % 8333) for count in line if isinstance(count, int)]
    sent = iter(answers)
    data = b"".join(item if isinstance(item, bytes) else encode(next(sent)) for item in line)
    reader = AnswerReader()
    found = [answer for at in range(0, len(data), piece) for answer in reader.feed(data[at : at + piece])]
    if all(isinstance(item, int) for item in line):
        assert found == answers
        assert reader.garbage == 0
    assert len(found) * 10 + reader.garbage <= len(data)


@given(st.binary(min_size=8, max_size=8), st.binary(max_size=4))
def test_the_name_is_believed_by_its_checksum(name: bytes, before: bytes) -> None:
    assert crc8(b"123456789") == 0xA1  # the check value of CRC-8/MAXIM
    assert name_in(name + b"%02X" % crc8(name)) == name.rstrip(b"\0").decode("ascii", "replace")
    assert name_in(b"TRIG0001") is None


@pytest.mark.parametrize(
    ("hz", "icr1", "prescaler"), [(30.0, 8332, 64), (29.97, 8341, 64), (100.0, 19_999, 8), (1000.0, 1999, 8)]
)
def test_the_nearest_rate_is_taken(hz: float, icr1: int, prescaler: int) -> None:
    rate = nearest_rate(hz)
    assert (rate.icr1, rate.prescaler) == (icr1, prescaler)
    assert rate.hz == pytest.approx(hz, rel=5e-4 if hz < 1000 else 1e-12)
    assert rate.command == b"T=" + icr1.to_bytes(2, "little") + (b"1" if prescaler == 8 else b"2")


@pytest.mark.parametrize("hz", [3.8, 1001.0])
def test_a_rate_that_the_timer_cannot_make_is_refused(hz: float) -> None:
    with pytest.raises(BadInputError, match=r"set trigger.rate_hz to 3\.81 to 1000"):
        nearest_rate(hz)
    with pytest.raises(ValueError, match="rate_hz"):
        TriggerBoxTrigger(source="triggerbox", rate_hz=hz)
    assert trigger_source(TriggerBoxTrigger(source="triggerbox", rate_hz=3.82)).spread_ns == 0


@settings(max_examples=50)
@given(st.integers(0, 2**32), st.floats(-4000, 4000), st.sampled_from([0.3, 2.0, 16.0]), st.floats(0.0, 1.0))
def test_true_times_lie_within_the_uncertainty_of_the_line(
    seed: int, ppm: float, longest_ms: float, share: float
) -> None:
    """Round trips of any length, of which the reading may be at any end: the bound holds all the same."""
    chance = random.Random(seed)
    period = nearest_rate(30.0).period_ns
    clock, now = BoxClock(period), 5e9
    true_period = period * (1 + ppm * 1e-6)
    for _ in range(150):
        way = chance.uniform(0.05, longest_ms) * MS
        read_at = now + share * way
        assert clock.add(Reading(HostNs(round(now)), HostNs(round(now + way)), read_at / true_period))
        now += way + 100 * MS
        if clock.line is not None:
            number = round(now / true_period)
            assert abs(clock.line.at(number) - number * true_period) <= 1.5 * clock.line.uncertainty_ns
    assert not clock.broken
    for _ in range(3):
        clock.add(Reading(HostNs(round(now)), HostNs(round(now + MS)), 3.0))
        now += 100 * MS
    assert clock.broken


class Listener:
    """Runs a keeper in a thread, and notes what it says."""

    def __init__(self, port: Path, timer: CrystalTimer, hz: float) -> None:
        self._timer, self._news = timer, threading.Condition()
        self._stop = threading.Event()
        self.gate = Gate()
        self.said: list[tuple[Level, Phrase]] = []
        self.numbers: list[int] = []
        self.errors: list[float] = []
        self.bound = 0
        keeper = TrainKeeper(
            str(port), nearest_rate(hz), hz, self.gate, tell=self._tell, fired=self._fired, wait=self._stop.wait
        )  # fmt: skip
        self._thread = threading.Thread(target=keeper.run)
        self._thread.start()

    def _tell(self, level: Level, said: Phrase) -> None:
        with self._news:
            self.said.append((level, said))
            self._news.notify_all()

    def _fired(self, fired: Fired) -> None:
        with self._news:
            self.numbers += range(fired.first, fired.first + len(fired.times))
            self.bound = max(self.bound, fired.uncertainty_ns)
            for time in fired.times:
                number = round((time - self._timer.rose_at(0)) / self._timer.period_ns)
                self.errors.append(abs(time - self._timer.rose_at(number)))
            self._news.notify_all()

    def hears(self, condition: Callable[[], bool]) -> None:
        with self._news:
            assert self._news.wait_for(condition, LONG_S), self.said

    @property
    def codes(self) -> list[str]:
        return [said.code for _, said in self.said]

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(LONG_S)
        assert not self._thread.is_alive()


@contextmanager
def driven(box: BoxSettings, folder: Path, hz: float = 100.0) -> Iterator[tuple[EmulatedBox, CrystalTimer, Listener]]:
    timer = CrystalTimer(ppm=80)
    with EmulatedBox(folder / "box", timer, box) as emulated:
        listener = Listener(folder / "box", timer, hz)
        try:
            yield emulated, timer, listener
        finally:
            listener.stop()


@pytest.mark.parametrize(
    "box",
    [
        pytest.param(BoxSettings(), id="good"),
        pytest.param(BoxSettings(jitter_s=0.004, garbage=0.2, mute=0.1), id="disturbed line"),
        pytest.param(BoxSettings(opens_anew=False), id="runs already"),
    ],
)
def test_every_pulse_is_told_once_with_a_time_that_is_true(tmp_path: Path, box: BoxSettings) -> None:
    with driven(box, tmp_path) as (_, timer, listener):
        listener.hears(lambda: len(listener.numbers) > 100)
        assert listener.codes == ["trigger_running"]
        listener.stop()
        wait_until(lambda: not timer.runs, "the pulses end", LONG_S)
    assert listener.numbers == list(range(listener.numbers[0], listener.numbers[0] + len(listener.numbers)))
    assert max(listener.errors) <= listener.bound + 2 * MS  # this thread may be late beside others


def test_a_box_that_begins_anew_or_is_pulled_out_is_told_and_started_again(tmp_path: Path) -> None:
    with driven(BoxSettings(), tmp_path) as (box, _, listener):
        listener.hears(lambda: len(listener.numbers) > 20)
        box.reset()
        listener.hears(lambda: listener.codes.count("trigger_running") == 2)
        listener.hears(lambda: listener.numbers[-1] > listener.numbers[20] + 20)
        box.pull_out()
        listener.hears(lambda: "trigger_gone" in listener.codes)
        box.plug_in()
        listener.hears(lambda: listener.codes.count("trigger_running") == 3)
    assert listener.codes == ["trigger_running", "trigger_anew", "trigger_running", "trigger_gone", "trigger_running"]
    steps = [after - before for before, after in zip(listener.numbers, listener.numbers[1:], strict=False)]
    assert min(steps) == 1
    assert sum(step > 1 for step in steps) <= 2, "each train leaves numbers out, and nothing else does"


@pytest.mark.parametrize(("box", "code"), [(BoxSettings(version=11), "trigger_protocol"), (None, "trigger_no_port")])
def test_what_is_wrong_is_said_once(tmp_path: Path, box: BoxSettings | None, code: str) -> None:
    with driven(box or BoxSettings(), tmp_path) as (emulated, _, listener):
        if box is None:
            listener.hears(lambda: bool(listener.numbers))
            emulated.pull_out()
            listener.hears(lambda: code in listener.codes)
            assert listener.codes == ["trigger_running", "trigger_gone", code]
            return
        listener.hears(lambda: code in listener.codes)
        assert listener.said[0][0] is Level.ERROR


def test_a_train_stands_still_and_makes_pulses_on_request(tmp_path: Path) -> None:
    with driven(BoxSettings(), tmp_path, hz=20.0) as (_, timer, listener):
        listener.hears(lambda: len(listener.numbers) > 5)
        listener.gate.let(0)
        wait_until(lambda: not timer.runs, "the pulses stop", LONG_S)
        listener.gate.let(6)
        wait_until(lambda: timer.runs, "the burst begins", LONG_S)
        wait_until(lambda: not timer.runs, "the burst ends", LONG_S)
        made = timer.read(host_now())[0]
        told = len(listener.numbers)
        listener.gate.let(None)
        listener.hears(lambda: len(listener.numbers) > told + 5)
        assert max(listener.errors) <= listener.bound + 2 * MS
    assert ("trigger_burst" in listener.codes) == (made != 6), "the machine is busy: one pulse more or less is told"
    assert abs(made - 6) <= 3


def test_a_box_that_falls_silent_is_told(tmp_path: Path) -> None:
    with driven(BoxSettings(), tmp_path) as (box, _, listener):
        listener.hears(lambda: bool(listener.numbers))
        box.silent = True
        listener.hears(lambda: "trigger_unanswered" in listener.codes)
