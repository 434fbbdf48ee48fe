"""Every fault of single frames, and what the real Aravis says about it."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.world.faults import Fault, FaultKind
from tests.simrig.gige.conftest import MakeCamera, SimulatedCamera
from tests.simrig.gige.receiver import Received, Receiver
from tests.support.waiting import wait_until

PACKETS = 11  # of a frame: 320 x 240 px in 9000-byte packets, leader and trailer included


def inject(simulated: SimulatedCamera, kind: FaultKind, **fields: object) -> None:
    simulated.camera.inject(Fault.model_validate({"kind": kind, "camera": "K1", **fields}))


def around_fault(receiver: Receiver, simulated: SimulatedCamera, kind: FaultKind, **fields: object) -> list[Received]:
    """Eleven buffers; the fault befalls one of the first."""
    before = receiver.frames(1)
    inject(simulated, kind, **fields)
    return before + receiver.frames(10)


def steps(frames: list[Received], value: Callable[[Received], int]) -> list[int]:
    return sorted({value(later) - value(earlier) for earlier, later in pairwise(frames)})


def test_missed_pulse_leaves_no_gap_in_the_ids(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        frames = around_fault(receiver, simulated, FaultKind.MISSED_PULSE)
        assert receiver.count("n_missing_frames") == 0
        _await_count(receiver, frames[-1].block_id)
    assert steps(frames, lambda frame: frame.block_id) == [1]
    assert steps(frames, lambda frame: frame.pulse) == [1, 2]
    assert max(later.device_ns - earlier.device_ns for earlier, later in pairwise(frames)) > 30_000_000
    assert simulated.camera.statistics().missed == 1


def _await_count(receiver: Receiver, arrived: int) -> None:
    """Wait until the camera has counted as many triggers as have frames: pulses come all the while."""

    def agree() -> bool:
        nonlocal arrived
        arrived = max([arrived, *(frame.block_id for frame in receiver.frames(60, timeout_s=0.01))])
        counted = receiver.device.get_integer_feature_value("CounterValue")
        assert counted >= arrived
        return bool(counted == arrived)

    wait_until(agree, "as many triggers as frames")


def test_lost_frames_leave_a_gap_that_aravis_counts_once(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        frames = around_fault(receiver, simulated, FaultKind.LOST_FRAME, count=3)
        assert receiver.count("n_missing_frames") == 1, "per gap, not per frame"
    assert steps(frames, lambda frame: frame.block_id) == [1, 4]
    assert steps(frames, lambda frame: frame.pulse) == [1, 4]
    assert [frame.status for frame in frames] == ["success"] * 11


@pytest.mark.parametrize("extended", [False, True], ids=["16-bit ids", "64-bit ids"])
def test_lost_packets_are_resent(make_camera: MakeCamera, extended: bool) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, extended=extended) as receiver:
        frames = around_fault(receiver, simulated, FaultKind.LOST_PACKETS, packets=[3, 4])
        resent = receiver.count("n_resent_packets")
    assert [frame.status for frame in frames] == ["success"] * 11
    assert steps(frames, lambda frame: frame.pulse) == [1], "the stamps are whole"
    statistics = simulated.camera.statistics()
    assert statistics.resent_packets == resent >= 2
    assert statistics.resend_requests >= 1
    # a starved machine delivers other packets so late that they are asked for as well
    assert resent == 2 or statistics.resend_requests > 1


def test_lost_trailer_is_resent(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        frames = around_fault(receiver, simulated, FaultKind.LOST_PACKETS, packets=[PACKETS - 1])
    assert [frame.status for frame in frames] == ["success"] * 11


def test_lost_leader_is_resent(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        frames = around_fault(receiver, simulated, FaultKind.LOST_LEADER)
    assert [frame.status for frame in frames] == ["success"] * 11
    assert steps(frames, lambda frame: frame.pulse) == [1]


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        (FaultKind.LOST_PACKETS, {"packets": [3, 4], "resend": False}),
        (FaultKind.LOST_LEADER, {"resend": False}),
        (FaultKind.DAMAGED_FRAME, {}),
    ],
)
def test_frames_that_stay_incomplete_time_out(
    make_camera: MakeCamera, kind: FaultKind, fields: dict[str, object]
) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, retention_us=300_000) as receiver:
        frames = around_fault(receiver, simulated, kind, **fields)
        assert receiver.count("n_timeouts") == 1
        assert receiver.count("n_missing_frames") == 0
    assert sorted(frame.status for frame in frames) == ["success"] * 10 + ["timeout"]
    whole = [frame for frame in frames if frame.status == "success"]
    assert steps(whole, lambda frame: frame.pulse) == [1, 2]
    assert steps(whole, lambda frame: frame.block_id) == [1, 2]


def test_a_camera_that_cannot_resend(make_camera: MakeCamera) -> None:
    simulated = make_camera(resend=False, rate_hz=30.0)
    with Receiver(simulated.address) as receiver:
        frames = around_fault(receiver, simulated, FaultKind.LOST_PACKETS, packets=[3, 4])
    assert sorted(frame.status for frame in frames) == ["missing-packets"] + ["success"] * 10
    assert simulated.camera.statistics().resend_requests == 0


def test_slow_link_delays_and_then_recovers(make_camera: MakeCamera) -> None:
    """50 Mbit/s carry a frame of 320 x 240 px in 12.4 ms, but pulses come every 10 ms: the frame memory fills up."""
    simulated = make_camera(rate_hz=100.0)
    with Receiver(simulated.address) as receiver:
        before = receiver.frames(1)[0].pulse
        inject(simulated, FaultKind.SLOW_LINK, duration_s=0.3, mbit_s=50.0, at_pulse=before + 10)
        frames = receiver.frames(60)
    assert [frame.status for frame in frames] == ["success"] * 60
    statistics = simulated.camera.statistics()
    delay = {p: sent - simulated.train.time(p) for p, sent in statistics.last_packets.items()}
    assert delay[HillPulse(before + 30)] > 1_000_000 + 20 * 2_000_000, "every frame came 2 ms later than the one before"
    assert delay[HillPulse(before + 30)] > 5 * delay[HillPulse(before + 58)], "and then the link caught up"


def test_a_frame_under_way_does_not_hold_up_the_end(make_camera: MakeCamera) -> None:
    """At 0.01 Mbit/s one packet takes 7 s; the fixtures see to it that nothing is left of the camera after the test."""
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        pulse = receiver.frames(1)[0].pulse
        inject(simulated, FaultKind.SLOW_LINK, duration_s=60.0, mbit_s=0.01)
        wait_until(lambda: simulated.camera.statistics().triggers > 10, "pulses come as before")
        assert max(simulated.camera.statistics().last_packets) <= pulse + 3


def test_scenario_faults_befall_their_own_camera(
    make_camera: MakeCamera, scenario_with: Callable[[str], object]
) -> None:
    fault = '[[faults]]\nkind = "lost_frame"\ncamera = "{}"\nat_pulse = {}\n'
    scenario = scenario_with(fault.format("K1", 50) + fault.format("K2", 55))
    simulated = make_camera(scenario=scenario)
    with Receiver(simulated.address) as receiver:
        frames = receiver.frames(60)
    assert {50, 55} & {frame.pulse for frame in frames} == {55}


def test_faults_that_come_too_late_are_refused(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        pulse = receiver.frames(3)[-1].pulse
        with pytest.raises(BadInputError, match="name a later one"):
            inject(simulated, FaultKind.LOST_FRAME, at_pulse=pulse - 1)
    with pytest.raises(BadInputError, match="SimulatedHill"):
        inject(simulated, FaultKind.RESTART, duration_s=1.0)
