"""The back end with the unmodified libdc1394 on the emulated bus: what the conformance suite does not test."""

import ctypes
import re
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from capture.iidc.bus import Bus
from capture.iidc.camera import IidcCamera
from capture.iidc.device import Device
from capture.iidc.library import SONAME
from capture.iidc.structures import Feature
from capture.seam import Arrival
from rig.clocks import host_now
from rig.errors import CameraError, CameraNotFoundError
from rig.frame import FrameRecord
from rig.pulse import HillPulse
from rig.settings.camera import CameraSettings
from rig.transport.ring import CameraRing
from simrig.images import stamp
from simrig.world.faults import Fault, FaultKind
from tests.capture.iidc.emulated import GUIDS, camera_ring, emulated_bus, settings
from tests.capture.rigs import SCENARIO
from tests.capture.whole import whole_frames

PERIOD_NS = 33_333_333
RATE_HZ = 30.0


@contextmanager
def opened(camera: CameraSettings, ring: CameraRing) -> Iterator[IidcCamera]:
    made = IidcCamera(camera, ring, RATE_HZ)
    try:
        yield made
    finally:
        made.close()


@contextmanager
def running(camera: CameraSettings) -> Iterator[tuple[IidcCamera, CameraRing]]:
    with camera_ring(camera) as ring, opened(camera, ring) as made:
        made.start()
        yield made, ring


def collect(camera: IidcCamera, ring: CameraRing, count: int) -> list[Arrival]:
    """The next arrivals; slots are given back at once, their pixels stay for a while."""
    arrivals: list[Arrival] = []
    deadline = host_now() + 20_000_000_000
    while len(arrivals) < count:
        assert host_now() < deadline, f"only {len(arrivals)} of {count} arrivals came"
        if (arrival := camera.receive(0.2)) is not None:
            arrivals.append(arrival)
            if isinstance(arrival, FrameRecord):
                ring.return_slot(arrival.slot)
    return arrivals


@contextmanager
def register_access(name: str = "K1") -> Iterator[Device]:
    """The camera's registers, read past the back end."""
    with Bus() as bus, Device(bus, bus.find(int(GUIDS[name], 16))) as device:
        yield device


def read_back(device: Device, name: str, *arguments: int) -> int:
    """A setting that the back end never asks for."""
    value = ctypes.c_uint32()
    function = ctypes.CDLL(SONAME)[f"dc1394_{name}"]
    assert function(device.pointer, *arguments, ctypes.byref(value)) == 0
    return value.value


@pytest.mark.parametrize(("edge", "polarity"), [("rising", 705), ("falling", 704)])
def test_the_camera_is_set_as_the_rig_file_says_and_its_exposure_stays(edge: str, polarity: int) -> None:
    camera = settings(exposure_us=1234.0, gain_db=6.0, trigger_edge=edge)
    with emulated_bus(), running(camera) as (made, ring), register_access() as device:
        collect(made, ring, 2)
        assert device.read_advanced(0x20C) & 0x3FFFFFF == 1234
        assert device.is_triggered()
        assert device.transmits()
        assert device.bandwidth_units() == 1292
        assert read_back(device, "external_trigger_get_polarity") == polarity
        assert read_back(device, "external_trigger_get_mode") == 384
        assert read_back(device, "external_trigger_get_source") == 576
        assert read_back(device, "feature_get_value", Feature.GAIN) == round(6.0 / 0.0354)
        assert read_back(device, "feature_get_mode", Feature.SHUTTER) == 736
        assert read_back(device, "video_get_framerate") == 36
        assert "640 x 480, 1292 bandwidth units, signs its frames" in made.description


def test_the_level_of_the_pulse_can_be_the_exposure() -> None:
    camera = settings(iidc={"trigger_mode": 1})
    with emulated_bus(), running(camera) as (made, ring), register_access() as device:
        assert read_back(device, "external_trigger_get_mode") == 385
        assert all(isinstance(arrival, FrameRecord) for arrival in collect(made, ring, 3))


def test_at_half_the_rate_packets_are_half_as_large() -> None:
    camera = settings()
    with emulated_bus(rate_hz=15.0), camera_ring(camera) as ring, closing(IidcCamera(camera, ring, 15.0)) as made:
        assert "652 bandwidth units" in made.description
        made.start()
        assert all(isinstance(arrival, FrameRecord) for arrival in collect(made, ring, 3))


def test_a_slow_frame_of_more_packets_than_the_kernel_keeps_headers_of_is_one_frame() -> None:
    camera = settings()
    with emulated_bus(rate_hz=7.0), camera_ring(camera) as ring, closing(IidcCamera(camera, ring, 7.0)) as made:
        assert made.transport_ns == 960 * 125_000
        made.start()
        arrivals = whole_frames(collect(made, ring, 4))
    assert [b.frame_id - a.frame_id for a, b in pairwise(arrivals)] == [1, 1, 1]


def test_pulses_of_a_hand_about_one_a_second(tmp_path: Path) -> None:
    presses = [pulse + 30 * turn for turn in range(8) for pulse in (0, 4, 10, 14, 19, 25)]  # 0.8 to 1.2 s apart
    pauses = [[a + 1, b] for a, b in pairwise(presses)]
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f'base = "{SCENARIO}"\nname = "hand"\npauses = {pauses}\n')
    camera, seen, triggers = settings(), [], []
    with (
        emulated_bus(rate_hz=5.0, scenario=scenario) as hill,
        camera_ring(camera) as ring,
        closing(IidcCamera(camera, ring, 1.0)) as made,
    ):
        made.start()
        for _ in range(5):
            (arrival,) = collect(made, ring, 1)
            assert isinstance(arrival, FrameRecord)
            pulse = stamp.read(ring.frame(arrival.slot).reshape(480, 640))
            assert pulse is not None
            seen.append(pulse.pulse)
            latch = made.latch()
            triggers.append(latch.host + arrival.device_time - latch.device - hill.train.time(pulse.pulse))
    assert seen == presses[presses.index(seen[0]) :][:5], "every press a frame"
    assert max(map(abs, triggers)) < 1_000_000


def test_frames_are_signed_and_the_signed_pixels_are_named() -> None:
    camera = settings()
    with emulated_bus() as hill, running(camera) as (made, ring):
        arrivals = whole_frames(collect(made, ring, 5))
        latch = made.latch()
        trigger = latch.host + arrivals[-1].device_time - latch.device
        pulse = stamp.read(ring.frame(arrivals[-1].slot).reshape(480, 640))
        assert pulse is not None
        assert abs(trigger - hill.train.time(pulse.pulse)) < 200_000 + latch.round_trip_ns / 2
    assert {(a.stamped.row, a.stamped.column, a.stamped.count) for a in arrivals if a.stamped} == {(479, 0, 12)}
    assert [arrival.frame_id for arrival in arrivals] == [arrival.trigger_count for arrival in arrivals]


def test_the_low_byte_first_is_understood_too() -> None:
    camera = settings()
    with emulated_bus(signature="little"), running(camera) as (made, ring):
        arrivals = whole_frames(collect(made, ring, 5))
    ids = [arrival.frame_id for arrival in arrivals]
    assert ids == list(range(ids[0], ids[0] + 5))
    assert ids[0] < 10


def test_without_a_signature_packets_tell_the_time() -> None:
    camera = settings()
    with emulated_bus(signature="none") as hill, running(camera) as (made, ring):
        assert "no signature" in made.description
        arrivals = whole_frames(collect(made, ring, 6))
        pulse = stamp.read(ring.frame(arrivals[-1].slot).reshape(480, 640))
        assert pulse is not None
        latch = made.latch()
        trigger = latch.host + arrivals[-1].device_time - latch.device
        assert abs(trigger - hill.train.time(pulse.pulse)) < 500_000
    assert {(arrival.trigger_count, arrival.stamped) for arrival in arrivals} == {(-1, None)}


def test_a_signature_that_is_not_wanted_is_switched_off() -> None:
    camera = settings(iidc={"signature": False})
    with emulated_bus(), register_access() as device, camera_ring(camera) as ring:
        with opened(settings(), ring):
            assert device.read_advanced(0x600) & 0x02000000
        with opened(camera, ring) as made:
            assert not device.read_advanced(0x600) & 0x02000000
            assert "no signature" in made.description
            made.start()
            assert {arrival.stamped for arrival in whole_frames(collect(made, ring, 3))} == {None}


@pytest.mark.parametrize("packet", [1, 2, 100, 240])
def test_a_lost_packet_never_passes_as_a_picture(packet: int) -> None:
    camera = settings()
    with emulated_bus() as hill, running(camera) as (made, ring):
        before = whole_frames(collect(made, ring, 3))
        hill.inject(Fault(kind=FaultKind.LOST_PACKETS, camera="K1", packets=(packet,)))
        after: list[Arrival] = []
        while len(after) < 10:
            after += collect(made, ring, 1)
            if isinstance(last := after[-1], FrameRecord):
                found = stamp.read(ring.frame(last.slot).reshape(480, 640))
                assert found is not None, "a torn frame was delivered as whole"
    whole = [arrival for arrival in after if isinstance(arrival, FrameRecord)]
    damaged = [arrival for arrival in after if not isinstance(arrival, FrameRecord)]
    steps = {b.frame_id - a.frame_id for a, b in zip([before[-1], *whole], whole, strict=False)}
    if packet == 1:  # the whole frame is skipped
        assert (len(damaged), steps) == (0, {1, 2})
    else:
        assert (len(damaged), steps) == (1, {1, 3})
        torn = damaged[0].device_time
        assert torn is not None
        before_it = max(arrival.device_time for arrival in [*before, *whole] if arrival.device_time < torn)
        assert abs(torn - before_it - PERIOD_NS) < 1_000_000


def test_an_overrun_counts_a_trigger_but_no_frame() -> None:
    camera = settings()
    with emulated_bus() as hill, running(camera) as (made, ring):
        arrivals = whole_frames(collect(made, ring, 3))
        hill.inject(Fault(kind=FaultKind.OVERRUN, camera="K1"))
        arrivals += whole_frames(collect(made, ring, 8))
    behind = [arrival.trigger_count - arrival.frame_id for arrival in arrivals]
    assert sorted(set(behind)) == [0, 1]
    assert behind == sorted(behind)


def test_a_bus_reset_is_noticed_and_costs_nothing() -> None:
    camera = settings()
    with emulated_bus() as hill, running(camera) as (made, ring):
        first = collect(made, ring, 3)
        hill.reset_bus()
        arrivals = collect(made, ring, 6)
        assert made.notices() == ["FireWire bus reset; the camera goes on as it was set"]
        assert made.notices() == []
    ids = [arrival.frame_id for arrival in whole_frames([*first, *arrivals])]
    assert ids == list(range(ids[0], ids[0] + len(ids)))


def test_a_camera_that_lost_its_settings_at_a_bus_reset_is_set_up_anew() -> None:
    camera = settings()
    with emulated_bus() as hill, running(camera) as (made, ring), register_access() as device:
        collect(made, ring, 2)
        device.set_transmission(on=False)
        while made.receive(0.1) is not None:
            pass
        hill.reset_bus()
        with pytest.raises(CameraError, match="lost its settings at a FireWire bus reset; connecting again"):
            collect(made, ring, 1)


def test_what_a_crashed_run_left_on_is_switched_off() -> None:
    camera = settings()
    with emulated_bus(), register_access() as device, camera_ring(camera) as ring:
        device.call("video_set_mode", 69)
        device.set_transmission(on=True)
        with opened(camera, ring) as made:
            assert not device.transmits()
            made.start()
            assert whole_frames(collect(made, ring, 2))[0].frame_id < 10
        assert not device.transmits()


def test_a_fourth_camera_finds_no_room_and_is_told_so() -> None:
    wide = {"width": 800, "height": 600}
    cameras = [settings(name, region=wide) for name in ("K1", "K2", "K3")]
    text = r"camera K3 finds no room on its FireWire bus: it needs 2012 of its 4915 bandwidth units"
    with emulated_bus(*GUIDS) as hill, camera_ring(cameras[0]) as ring:
        free = hill.bus_state().bandwidth
        with opened(cameras[0], ring), opened(cameras[1], ring), pytest.raises(CameraError, match=text):
            IidcCamera(cameras[2], ring, RATE_HZ)
        assert hill.bus_state().bandwidth == free


def test_a_region_of_the_sensor() -> None:
    region = {"x": 100, "y": 60, "width": 400, "height": 300}
    camera = settings(region=region)
    with emulated_bus(), running(camera) as (made, ring):
        assert "400 x 300 from 100, 60" in made.description
        arrivals = whole_frames(collect(made, ring, 4))
        assert stamp.read(ring.frame(arrivals[-1].slot).reshape(300, 400)) is not None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"region": {"x": 900, "width": 400, "height": 300}},
            "camera K1 has 1032 x 778 px, and no region of",
        ),
        ({"trigger_input": "Line3"}, 'camera K1 has no trigger_input Line3, but "Line0": correct it'),
        ({"gain_db": 60.0}, "camera K1 has 24.1 dB of gain at most: lower gain_db"),
        ({"iidc": {"iso_speed": 800}}, "camera K1 refuses its settings: dc1394_video_set_operation_mode"),
        ({"address": "0000000000000005"}, "camera K1: no FireWire camera with GUID 0000000000000005"),
    ],
)
def test_what_the_camera_cannot_do_is_said_before_it_starts(changes: dict[str, Any], text: str) -> None:
    camera = settings(**changes)
    with emulated_bus(), camera_ring(camera) as ring:
        descriptors = len(list(Path("/proc/self/fd").iterdir()))
        with pytest.raises((CameraError, CameraNotFoundError), match=re.escape(text)):
            IidcCamera(camera, ring, RATE_HZ)
        assert len(list(Path("/proc/self/fd").iterdir())) == descriptors


def test_a_stall_longer_than_the_ring_loses_frames_but_mixes_none() -> None:
    camera = settings()
    with emulated_bus() as hill, running(camera) as (made, ring):
        (_, first) = whole_frames(collect(made, ring, 2))
        stalled_until = hill.train.time(HillPulse(hill.train.next_index(host_now()) + 80))  # the ring holds 64
        wait_until_host(stalled_until)
        arrivals = collect(made, ring, 70)
        whole = [arrival for arrival in arrivals if isinstance(arrival, FrameRecord)]
        last = stamp.read(ring.frame(whole[-1].slot).reshape(480, 640))
    assert last is not None
    ids = [arrival.frame_id for arrival in whole]
    assert ids == sorted(set(ids))
    assert ids[-1] - first.frame_id > len(ids)
    for a, b in pairwise(whole):
        assert abs((b.device_time - a.device_time) - (b.frame_id - a.frame_id) * PERIOD_NS) < 500_000


def wait_until_host(host: int) -> None:
    """Let time pass while nothing fetches frames: this is the stall under test, not a wait for something."""
    while (remaining := host - host_now()) > 0:
        time.sleep(remaining / 1e9)


def test_closing_an_unplugged_camera_is_quick_and_silent() -> None:
    camera = settings()
    with emulated_bus() as hill, camera_ring(camera) as ring:
        made = IidcCamera(camera, ring, RATE_HZ)
        made.start()
        collect(made, ring, 2)
        hill.kill("K1")
        with pytest.raises(CameraError, match="is gone from the FireWire bus; check its power and cable"):
            collect(made, ring, 100)
        with pytest.raises(CameraError):
            made.latch()
        before = host_now()
        made.close()
        made.close()
        assert host_now() - before < 5_000_000_000
        with pytest.raises(CameraNotFoundError, match="camera K1: "):
            IidcCamera(camera, ring, RATE_HZ)
        hill.restart("K1")
        with opened(camera, ring) as again:
            again.start()
            assert all(isinstance(arrival, FrameRecord) for arrival in collect(again, ring, 3))
