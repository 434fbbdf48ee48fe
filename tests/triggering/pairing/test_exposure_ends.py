"""Cameras that note the end of a long exposure as the time of a frame stand beside others, and no triplet is mixed."""

import pytest
from msgspec.structs import replace

from rig.clocks import ClockLatch, DeviceNs
from rig.frame import FrameRecord, LatchRecord, Record
from tests.triggering.oracle import OK, check_no_pulse_is_mixed
from tests.triggering.simulation import MS, Hill, Run, Scenario

PULSES = 300
LOST = 0.01
JUMP = 10 * MS


def run(exposures_ms: tuple[float, ...], note_the_end: tuple[int, ...], latency_ms: tuple[int, int]) -> Run:
    exposures = tuple(round(each * MS) for each in exposures_ms)
    latency = (latency_ms[0] * MS, latency_ms[1] * MS)
    return Run(
        Hill(Scenario(pulses=PULSES, lost=LOST, exposures_ns=exposures, note_the_end=note_the_end, latency_ns=latency))
    )


@pytest.mark.parametrize("latency_ms", [(1, 5), (5, 20), (5, 45)])
@pytest.mark.parametrize("exposure_ms", [2, 9, 12, 20, 24, 28, 31])
@pytest.mark.parametrize("note_the_end", [(), (0,), (0, 1, 2)])
def test_no_triplet_is_mixed_at_any_exposure(
    exposure_ms: float, note_the_end: tuple[int, ...], latency_ms: tuple[int, int]
) -> None:
    tried = run((exposure_ms,) * 3, note_the_end, latency_ms)
    check_no_pulse_is_mixed(tried)
    complete = sum(all(outcome.status is OK for outcome in pulse.outcomes) for pulse in tried.closed)
    assert complete > PULSES * (1 - 3 * LOST) - 50  # the first ones find out what the camera notes


def test_exposures_may_differ() -> None:
    tried = run((2, 30, 15), (0, 1, 2), (5, 20))
    check_no_pulse_is_mixed(tried)
    subtracted = [camera.exposure_subtracted_us for camera in tried.pairer.health().cameras]
    assert subtracted == [0, 30_000, 15_000]  # a short one is learned as an offset


def _jumped(record: Record) -> Record:
    """A record after the camera's clock was set."""
    match record:
        case FrameRecord():
            return replace(record, device_time=DeviceNs(record.device_time + JUMP))
        case LatchRecord():
            latch = record.latch
            return LatchRecord(ClockLatch(DeviceNs(latch.device + JUMP), latch.host, latch.round_trip_ns), record.epoch)
        case _:
            return record


def test_a_clock_that_is_set_does_not_pass_for_the_other_end() -> None:
    """Times that jump ahead make frames seem early as well; the next reading of the clock tells."""
    hill = Hill(Scenario(pulses=PULSES, exposures_ns=(20 * MS,) * 3, latency_ns=(1 * MS, 3 * MS)))
    times = [time for time, camera, _ in hill.events if camera == 0]
    since = times[len(times) // 2]
    hill.events = [
        (
            time,
            camera,
            _jumped(record) if camera == 0 and time >= since else record,
        )
        for time, camera, record in hill.events
    ]
    tried = Run(hill)
    check_no_pulse_is_mixed(tried)
    camera = tried.pairer.health().cameras[0]
    assert (camera.exposure_subtracted_us, camera.clock_steps) == (0, 1)
