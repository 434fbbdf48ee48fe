from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from capture.replay.timeline import Timeline
from rig.clocks import DeviceNs, HostNs, UtcNs
from rig.frame import FrameStatus
from rig.tag import CameraTag

OK, LOST, MISSED, DAMAGED, ABSENT = FrameStatus
PERIOD = 10_000_000
START = HostNs(5_000_000_000)
LATENCY = 3_000_000


@dataclass
class Log:
    """A camera in a log that exists in memory only."""

    times: list[UtcNs] = field(default_factory=list)
    tags: list[CameraTag] = field(default_factory=list)
    period_ns: int = PERIOD
    name: str = "log.mcap"

    def read_into(self, out: NDArray[np.uint8], place: int) -> bool:
        out[:] = place
        return True


def make_log(
    statuses: Sequence[FrameStatus],
    *,
    first_id: int = 1,
    device: Callable[[int], int] = lambda at: 7_000_000_000 + at,
    modulus: int = 0,
) -> Log:
    """A camera that counts frames and triggers as cameras do; `device` is its clock, by ns since the first pulse."""
    log, frames, triggers = Log(), first_id - 1, first_id - 1
    for place, status in enumerate(statuses):
        time = UtcNs(1_700_000_000_000_000_000 + place * PERIOD)
        log.times.append(time)
        frames += status in {OK, LOST, DAMAGED}
        triggers += status in {OK, LOST, DAMAGED}
        shown = (frames - 1) % modulus + 1 if modulus else frames
        tag = CameraTag("K1", (0, 4), status)
        if status is OK:
            tag = CameraTag(
                "K1", (0, 4), status, shown, triggers, DeviceNs(device(place * PERIOD)), UtcNs(time + LATENCY), 0.0
            )
        log.tags.append(tag)
    return log


def test_pulses_follow_the_log_and_go_on_without_a_pause() -> None:
    timeline = Timeline(make_log([OK] * 5), START)
    assert [timeline.pulse_time(n) - START for n in range(12)] == [n * PERIOD for n in range(12)]
    assert [timeline.arrival(n) - timeline.pulse_time(n) for n in range(12)] == [LATENCY] * 12


@pytest.mark.parametrize("after", [-1_000_000_000, -1, 0, 1, PERIOD - 1, PERIOD, 4 * PERIOD, 5 * PERIOD, 123_456_789])
def test_the_next_pulse_is_the_first_one_later(after: int) -> None:
    timeline = Timeline(make_log([OK] * 5), START)
    pulse = timeline.next_pulse(HostNs(START + after))
    assert timeline.pulse_time(pulse) > START + after
    assert pulse == 0 or timeline.pulse_time(pulse - 1) <= START + after


def test_pauses_of_the_log_are_kept() -> None:
    log = make_log([OK] * 4)
    log.times[2:] = [UtcNs(time + 1_000_000_000) for time in log.times[2:]]
    timeline = Timeline(log, START)
    assert timeline.pulse_time(2) - timeline.pulse_time(1) == PERIOD + 1_000_000_000
    assert timeline.pulse_time(4) - timeline.pulse_time(3) == PERIOD


@pytest.mark.parametrize(
    "statuses",
    [
        [OK] * 6,
        [LOST, OK, OK, MISSED, OK, LOST],
        [MISSED, DAMAGED, OK, LOST, OK, DAMAGED, MISSED],
    ],
)
def test_ids_and_clock_count_on_from_round_to_round(statuses: list[FrameStatus]) -> None:
    timeline = Timeline(make_log(statuses, first_id=100, device=lambda at: 10**18 + at + at // 20_000), START)
    pulses = [n for n in range(4 * len(statuses)) if timeline.tag(n).status is OK]
    unbroken = make_log(statuses * 4, first_id=100)
    assert [timeline.frame_id(n) for n in pulses] == [unbroken.tags[n].frame_id for n in pulses]
    assert [timeline.trigger_count(n) for n in pulses] == [unbroken.tags[n].trigger_count for n in pulses]
    assert {timeline.connection(n) for n in pulses} == {0}
    for n in pulses:  # so few frames tell little of the drift, but frames and latches agree in every round
        assert abs(timeline.frame_device_time(n) - timeline.device_time(timeline.pulse_time(n), 0)) < 3_000


def test_the_clock_between_frames_runs_as_the_frames_tell() -> None:
    log = make_log([OK, OK, DAMAGED, LOST] * 100, device=lambda at: 7_000_000_000 + at - at // 40_000)  # -25 ppm
    timeline = Timeline(log, START)
    for at in (0, 55_000_000, 2 * PERIOD, 39_000_000_000):
        expected = 7_000_000_000 + at - at // 40_000
        assert abs(timeline.device_time(HostNs(START + at), 0) - expected) < 1_000
    assert abs(timeline.frame_device_time(2) - (7_000_000_000 + 2 * PERIOD)) < 1_000


def test_two_frames_make_no_drift_of_their_jitter() -> None:
    jitter = iter([0, 20_000])
    timeline = Timeline(make_log([OK, OK], device=lambda at: at + next(jitter)), START)
    assert abs(timeline.device_time(HostNs(START + 1_000_000_000), 0) - 1_000_000_000) < 100_000


def test_a_clock_or_ids_that_began_anew_are_a_new_connection() -> None:
    before, after = make_log([OK] * 4, first_id=50), make_log([ABSENT] * 2 + [OK] * 4, device=lambda at: at)
    after.times = [UtcNs(time + 4 * PERIOD) for time in after.times]
    joined = Log(before.times + after.times, before.tags + after.tags)
    timeline = Timeline(joined, START)
    assert [timeline.connection(n) for n in range(12)] == [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0]
    assert timeline.present_from(4) == 6
    assert abs(timeline.device_time(timeline.pulse_time(7), 1) - 3 * PERIOD) < 1_000
    assert abs(timeline.device_time(timeline.pulse_time(1), 0) - 7_000_000_000 - PERIOD) < 1_000


def test_ids_of_16_bits_wrap_and_are_no_new_connection() -> None:
    statuses = [OK, OK, LOST, OK, MISSED, OK, OK]
    timeline = Timeline(make_log(statuses, first_id=65533, modulus=65535), START)
    assert timeline.id_modulus == 65535
    pulses = [n for n in range(3 * len(statuses)) if timeline.tag(n).status is OK]
    assert {timeline.connection(n) for n in pulses} == {0}
    unbroken = make_log(statuses * 3, first_id=65533, modulus=65535)
    assert [timeline.frame_id(n) for n in pulses] == [unbroken.tags[n].frame_id for n in pulses]


def test_a_camera_that_was_never_there_is_never_present() -> None:
    timeline = Timeline(make_log([ABSENT] * 3), START)
    assert timeline.present_from(1) is None


def test_a_camera_without_counter_of_triggers_stays_without() -> None:
    log = make_log([OK] * 3)
    log.tags = [CameraTag("K1", (0, 4), OK, 1 + n, None, tag.device_time) for n, tag in enumerate(log.tags)]
    assert [Timeline(log, START).trigger_count(n) for n in range(6)] == [-1] * 6
