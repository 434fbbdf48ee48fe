"""A GigE Vision camera that is told to expose: real commands through the real Aravis, with and without a clock."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from capture.aravis.camera import AravisCamera
from rig.clocks import HostNs, host_now
from rig.errors import CameraError
from rig.frame import FrameRecord, LatchRecord, NoticeRecord, Record
from rig.settings.model import RigSettings
from rig.settings.trigger import SoftwareTrigger
from rig.transport.ring import CameraRing
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from simrig.gige.registers.makers import Maker
from tests.capture.rigs import SCENARIO, make_rig
from tests.capture.station import Station
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from triggering.sources.choice import trigger_source
from triggering.sources.even_train import EvenTrain

_FRAMES = 12


@contextmanager
def _camera(rig: RigSettings, *, clock: bool = True, maker: Maker = Maker.STANDARD) -> Iterator[CameraRing]:
    """A simulated camera in this process and the ring for its frames; `clock`: whether its clock can be read."""
    config = CameraConfig(
        name="K2", address=rig.cameras[0].address, scenario=SCENARIO, rate_hz=rig.trigger.rate_hz, epoch=host_now(),
        test_pattern=True, ptp_offset_ns=0, maker=maker,
    )  # fmt: skip
    camera, ring = Camera(config), CameraRing.create("K2", rig.cameras[0].frame_bytes, 16)
    if not clock:
        camera._device._registers.on_write("GevTimestampControl", lambda _: 0)
    camera.start()
    try:
        yield ring
    finally:
        camera.stop()
        ring.close()


def _host_times(records: list[Record]) -> list[HostNs]:
    """Trigger times of the frames on the host's clock, by the best reading of the camera's."""
    latches = [record.latch for record in records if isinstance(record, LatchRecord)]
    best = min(latches, key=lambda latch: latch.round_trip_ns)
    frames = [record for record in records if isinstance(record, FrameRecord)]
    return [HostNs(best.host + (record.device_time - best.device)) for record in frames]


@pytest.mark.parametrize("clock", [True, False])
def test_a_camera_exposes_at_each_command(tmp_path: Path, loopback: Loopback, clock: bool) -> None:
    rig = make_rig(tmp_path, "aravis", loopback, names=["K2"], source="software", rate_hz=10.0)
    trigger, origin = rig.trigger, host_now()
    assert isinstance(trigger, SoftwareTrigger)
    source = trigger_source(trigger)

    def opened(ring: CameraRing) -> AravisCamera:
        return AravisCamera(rig.cameras[0], rig.network, ring, trigger.period_ns, trigger)

    with _camera(rig, clock=clock) as ring, Station(opened, ring, source.commands(origin)) as station:
        station.await_records(FrameRecord, _FRAMES)
    frames = [record for record in station.records if isinstance(record, FrameRecord)]
    placed = [divmod(time - origin, trigger.period_ns) for time in _host_times(station.records)]
    assert len({pulse for pulse, _ in placed}) == len(frames)
    drift_ns = 500_000  # 100 ppm of some seconds
    # A busy machine may wake up the simulated camera later than that now and then.
    assert np.median([late for _, late in placed]) <= source.spread_ns + drift_ns
    assert all(frame.host_time > time for frame, time in zip(frames, _host_times(station.records), strict=True))
    notices = [record.text for record in station.records if isinstance(record, NoticeRecord)]
    assert [True for notice in notices if "its clock cannot be read: its frames have the times" in notice] == (
        [] if clock else [True]
    )


class _FewCommands:
    """Commands like those of a grabber that is too late for all others: `left` more are given in time."""

    def __init__(self, left: int) -> None:
        self.left = left

    def until_next_ns(self, now: HostNs) -> int:
        del now
        return 10_000_000

    def is_due(self, now: HostNs) -> bool:
        del now
        self.left -= 1
        return self.left >= 0

    def begin(self) -> None:
        pass

    def withheld(self) -> int:
        return 0


class _LateCommands(EvenTrain):
    """Commands of a grabber that wakes up two tenths of the period after most pulses."""

    def until_next_ns(self, now: HostNs) -> int:
        return super().until_next_ns(now) + 20_000_000


def test_commands_that_come_too_late_are_told_of(tmp_path: Path, loopback: Loopback) -> None:
    rig = make_rig(tmp_path, "aravis", loopback, names=["K2"], source="software", rate_hz=10.0)
    trigger = rig.trigger
    assert isinstance(trigger, SoftwareTrigger)
    commands = _LateCommands(host_now(), trigger.period_ns, trigger.latest_ns, trigger.latest_ns)

    def opened(ring: CameraRing) -> AravisCamera:
        return AravisCamera(rig.cameras[0], rig.network, ring, trigger.period_ns, trigger)

    with _camera(rig) as ring, Station(opened, ring, commands) as station:
        station.await_records(NoticeRecord, 1)
    (notice,) = [record.text for record in station.records if isinstance(record, NoticeRecord)]
    assert "pulses had no command, which would have come too late: this computer is too slow for them" in notice


def test_a_camera_that_was_not_told_to_expose_is_not_silent(tmp_path: Path, loopback: Loopback) -> None:
    rig = make_rig(tmp_path, "aravis", loopback, names=["K2"], source="software", rate_hz=10.0)
    trigger, commands = rig.trigger, _FewCommands(left=3)
    assert isinstance(trigger, SoftwareTrigger)

    def opened(ring: CameraRing) -> AravisCamera:
        return AravisCamera(rig.cameras[0], rig.network, ring, trigger.period_ns, trigger)

    with _camera(rig) as ring, Station(opened, ring, commands) as station:
        station.await_records(FrameRecord, 1)
        ring.request_reconnect()
        wait_until(lambda: commands.left < -100, "the grabber has looked for a frame for some time")
        commands.left = 3
        station.await_records(FrameRecord, 2)
    assert {record.epoch for record in station.records} == {1}


def test_a_camera_without_the_command_is_refused(tmp_path: Path, loopback: Loopback) -> None:
    rig = make_rig(tmp_path, "aravis", loopback, names=["K2"], source="software")
    assert isinstance(rig.trigger, SoftwareTrigger)
    with (
        _camera(rig, maker=Maker.IMAGING_SOURCE) as ring,
        pytest.raises(CameraError, match=r"takes no software trigger \(its TriggerSource has Any\)"),
    ):
        AravisCamera(rig.cameras[0], rig.network, ring, rig.trigger.period_ns, rig.trigger)
