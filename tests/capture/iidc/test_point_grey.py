"""Point Grey's cameras on the emulated bus: trigger mode 14, information in first pixels, other modes of Format7."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from typing import Any

import pytest

from capture.iidc.bus import Bus
from capture.iidc.camera import IidcCamera
from capture.iidc.device import Device
from rig.errors import CameraError
from rig.frame import FrameRecord
from rig.settings.camera import CameraSettings
from rig.transport.ring import CameraRing
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.faults import Fault, FaultKind
from svev.doctor.cameras.firewire_cameras import _look_at_signature
from tests.capture.iidc.emulated import camera_ring, settings, visible
from tests.capture.iidc.test_iidc_camera import collect
from tests.capture.rigs import SCENARIO
from tests.capture.whole import whole_frames

GUID = "00b09d01011b0001"
RATE_HZ = 30.0
PERIOD_NS = 33_333_333


@contextmanager
def _running(camera: CameraSettings) -> Iterator[tuple[SimulatedHill, IidcCamera, CameraRing]]:
    with (
        SimulatedHill(SCENARIO, {}, RATE_HZ, firewire={"K1": GUID}) as hill,
        visible(hill),
        camera_ring(camera) as ring,
        closing(IidcCamera(camera, ring, RATE_HZ)) as made,
    ):
        made.start()
        yield hill, made, ring


def _settings(**changes: Any) -> CameraSettings:
    return settings(address=GUID, **changes)


def test_frames_are_numbered_and_timed_by_their_first_pixels_and_a_lost_one_is_missed_by_its_number() -> None:
    camera = _settings(exposure_us=3000.0, iidc={"trigger_mode": 14})
    with _running(camera) as (hill, made, ring):
        assert "Point Grey" in made.description
        assert made.description.endswith("numbers and times its frames")
        first = collect(made, ring, 4)
        hill.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K1"))
        later = collect(made, ring, 12)
        with Bus() as bus, Device(bus, bus.find(int(GUID, 16))) as device:
            assert device.read_command(0x830) >> 16 & 0xF == 14
            assert device.absolute_boundaries(423)[0] == pytest.approx(20e-6)  # type: ignore[arg-type]
            assert _look_at_signature(camera, device).code == "check_numbers"
    arrivals = whole_frames([*first, *later])
    assert all(arrival.trigger_count == -1 for arrival in arrivals)
    stamped = arrivals[0].stamped
    assert stamped is not None
    assert (stamped.row, stamped.column, stamped.count) == (0, 0, 8)
    steps = {
        (after.frame_id - before.frame_id, round((after.device_time - before.device_time) / PERIOD_NS))
        for before, after in pairwise(arrivals)
    }
    assert steps == {(1, 1), (2, 2)}, "the frame that was lost is missing in numbers and in time alike"


def test_information_that_is_not_wanted_is_switched_off() -> None:
    with _running(_settings(iidc={"signature": False})) as (_, made, ring):
        assert "no signature" in made.description
        assert all(arrival.stamped is None for arrival in whole_frames(collect(made, ring, 2)))


def test_a_region_is_read_in_another_mode_of_format7() -> None:
    camera = _settings(region={"x": 8, "y": 4, "width": 320, "height": 240}, iidc={"format7_mode": 1})
    with _running(camera) as (_, made, ring):
        assert made.limits is not None
        assert made.limits.width == 1032
        assert all(isinstance(arrival, FrameRecord) for arrival in collect(made, ring, 3))
        with Bus() as bus, Device(bus, bus.find(int(GUID, 16))) as device:
            assert device.mode() == 89


def test_a_mode_that_the_camera_does_not_have_is_refused_with_those_that_it_has() -> None:
    told = r"camera K1 has no mode 5 of Format7 \(it has 0, 1\): correct iidc.format7_mode"
    with pytest.raises(CameraError, match=told), _running(_settings(iidc={"format7_mode": 5})):
        pass
