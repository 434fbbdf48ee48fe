"""What the grabber and the pairing rely on, tested with every source of pulses."""

import random
from typing import Any

import pytest
from pydantic import TypeAdapter

from capture.clock_reading import ClockReading
from rig.api.trigger import TriggerControl
from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import FrameRecord
from rig.settings.trigger import Trigger
from triggering.pairing.pairer import ClosedPulse, Pairer
from triggering.sources.choice import trigger_source
from triggering.sources.even_train import EvenTrain

#: The `[trigger]` tables, without the rate.
TABLES: dict[str, dict[str, Any]] = {
    "external": {"source": "external"},
    "software": {"source": "software"},
    "action": {"source": "action"},
    "action by broadcast": {"source": "action", "broadcast": ["192.168.8.255"]},
    "action by PTP": {"source": "action", "scheduled": True, "lead_ms": 5.0},
    "triggerbox": {"source": "triggerbox"},
    "gpio": {"source": "gpio", "line": 18},
    "iidc-broadcast": {"source": "iidc-broadcast"},
}
SOURCES = list(TABLES)
#: Those whose pulses are commands at times that the host chooses; of them, those that grabbers give.
COMMANDING, BY_GRABBERS = ["software", "action", "action by broadcast"], ["software"]
#: Those whose pulses others make.
ELSEWHERE = ["external"]
MS = 1_000_000
ORIGIN = HostNs(7_000 * MS)


def _settings(source: str, rate_hz: float = 30.0) -> Trigger:
    settings: Trigger = TypeAdapter(Trigger).validate_python({**TABLES[source], "rate_hz": rate_hz})
    return settings


@pytest.mark.parametrize("rate_hz", [0.1, 30.0, 200.0])
@pytest.mark.parametrize("source", SOURCES)
def test_frames_of_a_pulse_are_nearer_to_each_other_than_to_those_of_the_next(source: str, rate_hz: float) -> None:
    settings = _settings(source, max(rate_hz, 4.0) if source == "triggerbox" else rate_hz)
    made = trigger_source(settings)
    assert 0 <= made.spread_ns < 0.3 * settings.period_ns
    assert made.set_up_only <= (made.spread_ns > 0)
    assert (made.commands(ORIGIN) is not None) == (source in BY_GRABBERS)
    assert ((made.commands(ORIGIN) or made.sent(ORIGIN)) is not None) == (source in COMMANDING)


def _train(source: str) -> EvenTrain:
    made = trigger_source(_settings(source))
    train = made.commands(ORIGIN) or made.sent(ORIGIN)
    assert train is not None
    return train


@pytest.mark.parametrize("source", SOURCES)
def test_the_rate_of_pulses_is_changed_where_svev_makes_them(source: str) -> None:
    made = trigger_source(_settings(source))
    assert (TriggerControl.RATE in made.controls) == (source not in ELSEWHERE)


@pytest.mark.parametrize("source", COMMANDING)
def test_a_camera_is_told_once_for_each_pulse_and_in_time_or_not_at_all(source: str) -> None:
    settings, chance = _settings(source), random.Random(1)
    train, now, told = _train(source), HostNs(ORIGIN + 5 * MS), list[HostNs]()
    while len(told) < 200:
        if train.is_due(now):
            told.append(now)
        sleep = train.until_next_ns(now)
        assert 0 <= sleep < settings.period_ns
        now = HostNs(now + sleep + round(chance.expovariate(1 / (2 * MS))) + 1)
    pulses = [round((time - ORIGIN) / settings.period_ns) for time in told]
    assert pulses == sorted(set(pulses))
    assert all(0 <= (time - ORIGIN) % settings.period_ns <= trigger_source(settings).spread_ns / 2 for time in told)
    # Some of the waits were too long; the first pulse is over when the train is asked first.
    assert 0 < train.withheld() == pulses[-1] - len(pulses)
    assert train.withheld() == 0


@pytest.mark.parametrize("source", COMMANDING)
def test_what_is_past_when_a_camera_is_ready_is_not_made_up_for(source: str) -> None:
    train = _train(source)
    assert not train.is_due(HostNs(ORIGIN + MS))
    late = HostNs(ORIGIN + 10 * _settings(source).period_ns)
    assert train.is_due(late)
    assert not train.is_due(HostNs(late + MS))
    assert train.withheld() == 9
    train.begin()
    assert not train.is_due(HostNs(late + 100 * _settings(source).period_ns))
    assert train.withheld() == 0


@pytest.mark.parametrize("source", COMMANDING)
def test_a_frame_of_a_command_that_was_held_up_is_damaged_and_not_in_the_next_pulses_triplet(source: str) -> None:
    settings = _settings(source)
    made = trigger_source(settings)
    exposes = _train(source).exposes
    feed = _Feed(Pairer(3, settings.period_ns, hold_ns=250 * MS, spread_ns=made.spread_ns, exposes=exposes))
    for pulse in range(60):
        fired = ORIGIN + pulse * settings.period_ns
        feed.frame(0, fired + MS, pulse)
        feed.frame(1, fired + MS, pulse)
        if pulse % 10 == 5:
            feed.frame(2, fired + settings.period_ns - 2 * MS, pulse)  # nearer to the next pulse's frames
        elif pulse % 10 != 6:  # it was still busy
            feed.frame(2, fired + MS, pulse)
        feed.advance(fired + 20 * MS)
    feed.end(ORIGIN + 100 * settings.period_ns)
    seen = [{outcome.record.slot for outcome in pulse.outcomes if outcome.record} for pulse in feed.closed]
    assert seen == [{pulse} for pulse in range(60)]
    outcomes = [pulse.outcomes[2].status.value for pulse in feed.closed]
    assert sorted(outcomes) == ["damaged"] * 6 + ["missed"] * 6 + ["ok"] * 48


@pytest.mark.parametrize("source", COMMANDING)
def test_no_frame_gets_into_another_pulses_triplet_however_far_apart_they_are_exposed(source: str) -> None:
    settings = _settings(source)
    made, chance = trigger_source(settings), random.Random(2)
    exposes = _train(source).exposes
    feed = _Feed(Pairer(3, settings.period_ns, hold_ns=250 * MS, spread_ns=made.spread_ns, exposes=exposes))
    whole = 0
    for pulse in range(3000):
        fired = ORIGIN + pulse * settings.period_ns
        there = [chance.random() > 0.02 for _ in range(3)]
        whole += all(there)
        for camera in range(3):
            if there[camera]:
                feed.frame(camera, fired + round(chance.random() * made.spread_ns), pulse)
        feed.advance(fired + 20 * MS)
    feed.end(ORIGIN + 4000 * settings.period_ns)
    seen = [{outcome.record.slot for outcome in pulse.outcomes if outcome.record} for pulse in feed.closed]
    assert max(len(pulses) for pulses in seen) == 1
    assert sum(pulse.complete for pulse in feed.closed) == whole


class _Feed:
    """Cameras on one clock, which is read after each frame that comes out of turn; `slot` is the true pulse."""

    def __init__(self, pairer: Pairer) -> None:
        self._pairer = pairer
        self._ids, self._readings = [0, 0, 0], [ClockReading() for _ in range(3)]
        self.closed: list[ClosedPulse] = []
        for camera in range(3):
            pairer.connected(camera, 1, HostNs(ORIGIN - 100 * MS))
            self._latch(camera, HostNs(ORIGIN - 90 * MS))

    def frame(self, camera: int, time: int, pulse: int) -> None:
        """A frame exposed at `time` comes 10 ms later."""
        self._ids[camera] += 1
        host, device = HostNs(time + 10 * MS), DeviceNs(time)
        record = FrameRecord(host, pulse, self._ids[camera], 0, device, epoch=1)
        self._pairer.frame(camera, record)
        if self._readings[camera].is_due(host, device):
            self._latch(camera, host)
            self._readings[camera].done(host)

    def advance(self, now: int) -> None:
        """Decide what can be decided."""
        self._pairer.released(HostNs(now))
        self.closed += self._pairer.advance(HostNs(now))

    def end(self, now: int) -> None:
        """Read the clocks once more, for frames that wait for that, and decide all."""
        for camera in range(3):
            self._latch(camera, HostNs(now))
        self.advance(now)

    def _latch(self, camera: int, host: HostNs) -> None:
        self._pairer.latch(camera, ClockLatch(DeviceNs(host), host, 50_000))
