"""What the unmodified libdc1394 receives from healthy cameras."""

from itertools import pairwise
from typing import Any

import pytest

from rig.clocks import NS_PER_US, HostNs, UtcAnchor
from simrig.firewire.isochronous import CycleTimer
from simrig.world.pulses import DeviceClock
from simrig.world.scenario import Scenario
from tests.simrig.firewire.conftest import GUIDS, RefusedError, StartHill, StartProgram

PERIOD_US = 1e6 / 30
#: 30.5 ms of packets and up to a cycle until the first one.
TRANSPORT_US = 240 * 125
BANDWIDTH = 1292
NO_ISO_CHANNEL = -7


def seconds(cycle_time: int) -> float:
    return (cycle_time >> 25) + (cycle_time >> 12 & 0x1FFF) / 8000 + (cycle_time & 0xFFF) / 24.576e6


def test_three_cameras_in_three_processes_lose_nothing(start_hill: StartHill, start_program: StartProgram) -> None:
    hill = start_hill(3, test_pattern=False)
    programs = [start_program(hill, name) for name in ("K1", "K2", "K3")]
    for program in programs:
        program("start", 64)
    state = hill.bus_state()
    assert (state.bandwidth, state.channels) == (4915 - 3 * BANDWIDTH, (0, 1, 2))
    for program in programs:
        program.begin("frames", 120)
    seen: list[list[dict[str, Any]]] = [program.result() for program in programs]
    statistics = hill.statistics()
    assert all(camera.controlled and camera.acquiring for camera in statistics.values())
    for index, frames in enumerate(seen):
        assert {frame["camera"] for frame in frames} == {index}
        pulses = [frame["pulse"] for frame in frames]
        assert pulses == list(range(pulses[0], pulses[0] + 120)), "every pulse a frame"
        assert [frame["frame_count"] for frame in frames] == list(range(1, 121))
        assert [frame["trigger_count"] for frame in frames] == list(range(1, 121))
        assert all(frame["std"] > 10 for frame in frames), "there is something to see"
    by_pulse: dict[int, list[dict[str, Any]]] = {}
    for frame in (frame for frames in seen for frame in frames):
        by_pulse.setdefault(frame["pulse"], []).append(frame)
    complete = [frames for frames in by_pulse.values() if len(frames) == 3]
    assert len(complete) >= 110
    assert all(len({frame["cycle_time"] for frame in frames}) == 1 for frames in complete), "one clock for all"
    spread = [max(f["timestamp_us"] for f in frames) - min(f["timestamp_us"] for f in frames) for frames in complete]
    assert sorted(spread)[len(spread) // 2] <= 125


def test_a_frame_takes_as_long_as_its_packets(start_hill: StartHill, start_program: StartProgram) -> None:
    hill, anchor = start_hill(), UtcAnchor.take()
    program = start_program(hill, "K1")
    program("start")
    frames = program("frames", 30)
    for frame in frames:
        pulse = hill.train.time(frame["pulse"])
        assert frame["arrival_ns"] - pulse > (2_000 + 500 + TRANSPORT_US) * NS_PER_US, "not before its last packet"
    # Half of the timestamps are read on an idle machine: exposure 2.03 ms, then 0.5 ms and up to a cycle.
    ahead = sorted(frame["timestamp_us"] - anchor.utc(hill.train.time(frame["pulse"])) / 1000 for frame in frames)
    assert 2_500 < ahead[len(ahead) // 2] < 2_800


def test_the_signature_says_when_the_pulse_was(
    start_hill: StartHill, start_program: StartProgram, training: Scenario
) -> None:
    hill = start_hill()
    program = start_program(hill, "K1")
    program("start")
    timer = CycleTimer(DeviceClock(training, 0, hill.train.epoch).at)
    for frame in program("frames", 10):
        assert frame["cycle_time"] == timer.register(HostNs(hill.train.time(frame["pulse"]) + 8_000))
    register, _, host_ns = program("cycle_timer")
    assert 0 <= (seconds(timer.register(HostNs(host_ns))) - seconds(register)) % 128 < 0.5


@pytest.mark.parametrize(("signature", "order"), [("little", "little"), ("none", None)])
def test_other_signatures(
    start_hill: StartHill, start_program: StartProgram, signature: str, order: str | None
) -> None:
    program = start_program(start_hill(signature=signature), "K1")
    program("start")
    counts = [frame["frame_count"] for frame in program("frames", 3)]
    if order is None:
        assert program("advanced", 0x600) == 0, "no such register"
        assert counts[1] - counts[0] != 1
    else:
        assert [count.to_bytes(4, "big")[0] for count in counts] == [1, 2, 3]


def test_format7_shows_the_same_place_of_the_sensor(start_hill: StartHill, start_program: StartProgram) -> None:
    hill = start_hill(toml="stamp = false\n[image]\nnoise_sigma = 0\nsnow_flakes = 0\n", test_pattern=False)
    program = start_program(hill, "K1")
    program("start")
    (legacy,) = program("frames", 1)
    program("stop")
    assert program("format7", 196, 149, 640, 480, -3) == 1280, "recommended for 30 Hz"
    program("start")
    (same,) = program("frames", 1)
    assert (same["size"], same["packet_bytes"], same["packets"]) == ([640, 480], 1280, 240)
    assert abs(same["mean"] - legacy["mean"]) < 0.5
    program("stop")
    assert program("format7", 196, 149, 320, 200, 1000) == 1000
    program("arm")
    program("start")
    parts = program("frames", 5)
    assert {(tuple(frame["size"]), frame["packets"]) for frame in parts} == {((320, 200), 64)}
    counts = [frame["frame_count"] for frame in parts]
    assert [two - one for one, two in pairwise(counts)] == [1] * 4, "signed there, too"


def test_format7_refuses_what_does_not_fit(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    with pytest.raises(RefusedError):
        program("format7", 400, 0, 640, 480, -3)  # beyond the right edge
    with pytest.raises(RefusedError):
        program("format7", 0, 0, 642, 480, -3)  # between units


def test_a_camera_runs_free_without_trigger(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    program("run_free")
    program("start")
    frames = program("frames", 10)
    steps = [(seconds(two["cycle_time"]) - seconds(one["cycle_time"])) % 128 for one, two in pairwise(frames)]
    assert all(step == pytest.approx(1 / 30, abs=1e-4) for step in steps)
    assert {frame["trigger_count"] for frame in frames} == {0}


def test_half_the_frame_rate_has_half_the_packets(start_hill: StartHill, start_program: StartProgram) -> None:
    """At 15 Hz a frame is 480 packets of 640 bytes: every other pulse comes too early and is an overrun."""
    hill = start_hill()
    program = start_program(hill, "K1")
    program("call", "video_set_framerate", 35)
    program("start")
    frames = program("frames", 3)
    assert {(frame["packet_bytes"], frame["packets"]) for frame in frames} == {(640, 480)}
    assert hill.bus_state().bandwidth == 4915 - (640 // 4 + 3) * 4


def test_the_software_trigger(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(toml="pauses = [[0, 100000]]\n"), "K1")
    program("start")
    assert program("frames", 1, 0.2) == [], "no pulses"
    program("call", "software_trigger_set_power", 1)
    (frame,) = program("frames", 1)
    assert (frame["frame_count"], frame["trigger_count"]) == (1, 0)


def test_the_falling_edge_and_the_level(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    program("start")
    frames = program("frames", 1)
    program("call", "external_trigger_set_polarity", 704)
    frames += program("frames", 12)  # the ring holds some of pulses before the change
    at = [seconds(frame["cycle_time"]) * 30 for frame in frames]
    later = [(second - first + 0.5) % 1 / 30 - 1 / 60 for first, second in pairwise(at)]
    assert [step for step in later if abs(step) > 5e-6] == pytest.approx([500e-6], abs=2e-6)
    program("call", "external_trigger_set_mode", 385)
    assert program("get", "external_trigger_get_mode") == 385
    assert len(program("frames", 3)) == 3


def test_too_long_an_exposure_overruns(start_hill: StartHill, start_program: StartProgram) -> None:
    """The default shutter of 40 ms allows only every other of 30 pulses per second."""
    hill = start_hill()
    program = start_program(hill)
    program("open", GUIDS["K1"])
    program("configure", 2000)
    program("start")
    frames = program("frames", 10)
    assert [two["trigger_count"] - one["trigger_count"] for one, two in pairwise(frames)] == [2] * 9
    assert [two["frame_count"] - one["frame_count"] for one, two in pairwise(frames)] == [1] * 9
    assert hill.statistics()["K1"].overruns >= 9


def test_a_fourth_camera_does_not_fit(start_hill: StartHill, start_program: StartProgram) -> None:
    fourth = '[[cameras]]\nname = "K4"\nc = 1400\nX0 = [30.0, -30.0, -9.0]\nlook_at = [11.0, 0.0, -2.7]\n'
    hill = start_hill(4, _cameras() + fourth)
    programs = [start_program(hill, name) for name in GUIDS]
    for program in programs[:3]:
        program("start")
    with pytest.raises(RefusedError) as refusal:
        programs[3]("start")
    assert refusal.value.code == NO_ISO_CHANNEL, "the kernel tells it by the channel"
    assert hill.bus_state().bandwidth == 4915 - 3 * BANDWIDTH
    assert len(programs[0]("frames", 5)) == 5, "the others are not disturbed"
    programs[0]("stop")
    programs[3]("start")
    assert len(programs[3]("frames", 5)) == 5
    for program in programs:
        program.close()
    state = hill.bus_state()
    assert (state.bandwidth, state.channels) == (4915, ()), "all is given back"


def _cameras() -> str:
    return "".join(
        f'[[cameras]]\nname = "K{number}"\nc = 1400\nX0 = [{10 * number}.0, -30.0, -9.0]\nlook_at = [11.0, 0.0, -2.7]\n'
        for number in (1, 2, 3)
    )


def test_a_program_that_is_killed_gives_everything_back(start_hill: StartHill, start_program: StartProgram) -> None:
    hill = start_hill()
    program = start_program(hill, "K1")
    program("start")
    assert hill.bus_state().channels == (0,)
    program.process.kill()
    program.process.wait()
    again = start_program(hill, "K1")
    assert hill.bus_state().channels == ()
    again("start")
    assert len(again("frames", 5)) == 5
