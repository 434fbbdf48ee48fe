"""What the real Aravis receives from a healthy camera."""

import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from rig.clocks import HostNs
from rig.settings.file import CONFIG
from simrig.gige.protocol.gvcp import Command
from simrig.images import stamp
from simrig.images.view import CameraView
from simrig.world.pulses import PULSE_WIDTH_NS
from simrig.world.scenario import load_scenario
from tests.simrig.gige.conftest import TRAINING, MakeCamera
from tests.simrig.gige.raw_client import GvcpClient
from tests.simrig.gige.receiver import Received, Receiver
from tests.support.waiting import wait_until


def without_stamp(image: np.ndarray) -> np.ndarray:
    return image.ravel()[: -stamp.STAMP_BYTES]


@pytest.mark.parametrize("extended", [False, True], ids=["16-bit ids", "64-bit ids"])
def test_every_pulse_gives_one_frame_with_its_own_time(make_camera: MakeCamera, extended: bool) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, extended=extended) as receiver:
        frames = receiver.frames(60)
    assert [frame.status for frame in frames] == ["success"] * 60
    assert [frame.block_id for frame in frames] == list(range(1, 61))
    first = frames[0].pulse
    assert [frame.pulse for frame in frames] == list(range(first, first + 60))
    assert [frame.device_ns for frame in frames] == [
        simulated.clock.at_pulse(simulated.train.time(frame.pulse), frame.pulse) for frame in frames
    ]
    pulses = {frame.pulse for frame in frames}
    wait_until(lambda: set(simulated.camera.statistics().last_packets) >= pulses, "it is noted when they were sent")
    statistics = simulated.camera.statistics()
    assert statistics.overruns == statistics.missed == 0
    for pulse, sent in statistics.last_packets.items():
        assert sent >= simulated.train.time(pulse) + 1_000_000, "no packet before the end of the exposure"


def test_packet_socket(make_camera: MakeCamera) -> None:
    """The way that Aravis takes with CAP_NET_RAW; without it the plain socket is tested twice.

    While it sets up the socket Aravis takes foreign streams' packets for its own and may then take the first frames
    for old ones, so those are not insisted on. Nor is every later one: a crowded machine loses packets. But block ids
    and pulses go on together.
    """
    simulated = make_camera()
    with Receiver(simulated.address, packet_socket=True) as receiver:
        frames = [frame for frame in receiver.frames(60) if frame.status == "success"]
    assert len(frames) > 30
    steps = [(b.block_id - a.block_id, b.pulse - a.pulse) for a, b in pairwise(frames)]
    assert all(block_ids == pulses >= 1 for block_ids, pulses in steps), steps


@pytest.mark.parametrize("packet_size", [576, 1500, 9000, 65500])
def test_packet_sizes(make_camera: MakeCamera, packet_size: int) -> None:
    simulated = make_camera(rate_hz=20.0)
    with Receiver(simulated.address, packet_size=packet_size) as receiver:
        frames = receiver.frames(5)
    assert [frame.status for frame in frames] == ["success"] * 5
    expected = np.add.outer(np.arange(240), np.arange(320) + frames[0].pulse).astype(np.uint8)
    np.testing.assert_array_equal(without_stamp(frames[0].image), without_stamp(expected))


def test_16_bit_ids_wrap_and_leave_out_0(make_camera: MakeCamera) -> None:
    simulated = make_camera(first_block_id=65530)
    with Receiver(simulated.address) as receiver:
        frames = receiver.frames(10)
        assert receiver.count("n_missing_frames") == 0
    assert [frame.block_id for frame in frames] == [65530, 65531, 65532, 65533, 65534, 65535, 1, 2, 3, 4]


def test_64_bit_ids_go_on(make_camera: MakeCamera) -> None:
    simulated = make_camera(first_block_id=65530)
    with Receiver(simulated.address, extended=True) as receiver:
        frames = receiver.frames(10)
    assert [frame.block_id for frame in frames] == list(range(65530, 65540))


def test_ids_begin_anew_with_every_start(make_camera: MakeCamera) -> None:
    """With a new stream each time: an old one takes ids up to 100 below its last one for late packets."""
    simulated = make_camera()
    for _ in range(2):
        with Receiver(simulated.address) as receiver:
            assert [frame.block_id for frame in receiver.frames(3)] == [1, 2, 3]


def test_region_of_interest(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, region=(16, 8, 200, 100)) as receiver:
        frame = receiver.frames(1)[0]
    assert frame.image.shape == (100, 200)
    expected = np.add.outer(np.arange(8, 108), np.arange(16, 216) + frame.pulse).astype(np.uint8)
    np.testing.assert_array_equal(without_stamp(frame.image), without_stamp(expected))


def test_the_hill_is_what_the_camera_sees(make_camera: MakeCamera) -> None:
    simulated = make_camera("K2", test_pattern=False, rate_hz=20.0)
    view = CameraView(load_scenario(TRAINING), 1, 320, 240, 20.0)
    with Receiver(simulated.address) as receiver:
        frames = receiver.frames(3)
    for frame in frames:
        expected = np.zeros((240, 320), np.uint8)
        view.render_into(expected, frame.pulse)
        np.testing.assert_array_equal(frame.image, expected)


def test_prerendered_frames_carry_the_stamp_of_their_pulse(make_camera: MakeCamera) -> None:
    simulated = make_camera("K3", test_pattern=False, prerendered=2)
    with Receiver(simulated.address) as receiver:
        frames = receiver.frames(20)
    assert {later.pulse - earlier.pulse for earlier, later in pairwise(frames)} == {1}
    assert len({without_stamp(frame.image).tobytes() for frame in frames}) == 2
    assert stamp.read(frames[0].image) == stamp.Stamp(2, frames[0].pulse)


def test_free_run(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    receiver = Receiver(simulated.address, trigger=None)
    receiver.camera.set_frame_rate(80.0)
    with receiver:
        frames = receiver.frames(20)
    steps = [later.device_ns - earlier.device_ns for earlier, later in pairwise(frames)]
    assert steps == pytest.approx([12_500_000] * 19, abs=20_000), "the period and the jitter"


def test_free_run_as_fast_as_the_sensor(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    receiver = Receiver(simulated.address, trigger=None, exposure_us=20_000.0)
    receiver.device.set_boolean_feature_value("AcquisitionFrameRateEnable", False)
    with receiver:
        frames = receiver.frames(10)
    steps = [later.device_ns - earlier.device_ns for earlier, later in pairwise(frames)]
    assert steps == pytest.approx([20_000_000 + 240 * 5_000] * 9, abs=20_000), "exposure and read-out"
    assert simulated.camera.statistics().overruns == 0


def test_software_trigger(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    region = 0, 0, 320, 16  # is read out before it is sent, so that the sensor is ready again
    with Receiver(simulated.address, trigger="Software", exposure_us=10.0, region=region) as receiver:
        for number in range(1, 6):
            receiver.camera.software_trigger()
            assert [frame.block_id for frame in receiver.frames(1)] == [number]
        assert receiver.frames(1, timeout_s=0.05) == [], "no trigger, no frame"


def test_a_repeated_command_is_not_done_twice(make_camera: MakeCamera) -> None:
    """GVCP: a command whose acknowledge was lost comes again with the same request number."""
    simulated = make_camera()
    with Receiver(simulated.address, trigger="Software") as receiver, GvcpClient(simulated.address) as client:
        action = struct.pack(">III", 0x12, 0x34, 1)
        for name, value in (("ActionDeviceKey", 0x12), ("ActionGroupKey", 0x34), ("ActionGroupMask", 3)):
            receiver.device.set_integer_feature_value(name, value)
        receiver.device.set_string_feature_value("TriggerSource", "Action0")
        for _ in range(2):
            client.send(Command.ACTION, action, request_id=99)
            assert client.hear().status == 0
        assert len(receiver.frames(2, timeout_s=0.1)) == 1


def test_single_frame(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    for _ in range(2):
        with Receiver(simulated.address, AcquisitionMode="SingleFrame") as receiver:
            assert len(receiver.frames(2, timeout_s=0.1)) == 1
            assert not simulated.camera.statistics().acquiring


def test_pulses_that_come_too_early_are_overruns(make_camera: MakeCamera) -> None:
    simulated = make_camera(rate_hz=100.0)
    with Receiver(simulated.address, exposure_us=9500.0) as receiver:  # and 1.2 ms read-out, pulses every 10 ms
        frames = receiver.frames(10)
    assert {later.block_id - earlier.block_id for earlier, later in pairwise(frames)} == {1}
    assert {later.pulse - earlier.pulse for earlier, later in pairwise(frames)} == {2}
    assert simulated.camera.statistics().overruns >= 9


def test_falling_edge(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, TriggerActivation="FallingEdge") as receiver:
        frame = receiver.frames(1)[0]
    edge = HostNs(simulated.train.time(frame.pulse) + PULSE_WIDTH_NS)
    assert frame.device_ns == simulated.clock.at_pulse(edge, frame.pulse)


def test_a_line_without_a_cable(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, trigger="Line1") as receiver:
        assert receiver.frames(1, timeout_s=0.1) == []


def test_pauses_in_the_pulse_train(make_camera: MakeCamera, tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f'base = "{CONFIG / "scenarios" / "training.toml"}"\npauses = [[0, 50], [55, 70]]\n')
    simulated = make_camera(scenario=scenario)
    with Receiver(simulated.address) as receiver:
        frames: list[Received] = receiver.frames(10)
    assert [frame.pulse for frame in frames] == [50, 51, 52, 53, 54, 70, 71, 72, 73, 74]
    assert [frame.block_id for frame in frames] == list(range(1, 11))


def test_ticks_of_another_length(make_camera: MakeCamera) -> None:
    simulated = make_camera(tick_hz=125_000_000)
    with Receiver(simulated.address) as receiver:
        frame = receiver.frames(1)[0]
    expected = simulated.clock.at_pulse(simulated.train.time(frame.pulse), frame.pulse)
    assert frame.device_ns == expected // 8 * 8
