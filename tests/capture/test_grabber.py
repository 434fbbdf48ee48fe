"""The grabber's loop with an in-process camera: epochs, order of records, failures reported once, a full ring."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from capture.seam import Camera
from capture.sim.camera import SimCamera
from rig.clocks import host_now
from rig.errors import CameraNotFoundError
from rig.frame import ConnectedRecord, DisconnectedRecord, FrameRecord, LatchRecord, NoticeRecord
from rig.transport.ring import CameraRing
from service.processes.backends import camera_opener
from simrig.programs.scene import SimScene
from simrig.world.faults import Fault, FaultKind
from tests.capture.rigs import make_rig
from tests.capture.station import Station
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until


@pytest.fixture
def ring() -> Iterator[CameraRing]:
    made = CameraRing.create("K2", 640 * 480, 8)
    yield made
    made.close()


@contextmanager
def _station(directory: Path, loopback: Loopback, ring: CameraRing) -> Iterator[tuple[Station, SimScene]]:
    rig = make_rig(directory, "sim", loopback)
    scene = SimScene(rig, 1, host_now())
    with Station(lambda it: SimCamera(rig.cameras[1], it, scene), ring) as station:
        yield station, scene


def test_an_epoch_begins_with_its_connection_then_the_clock_then_frames(
    tmp_path: Path, loopback: Loopback, ring: CameraRing
) -> None:
    with _station(tmp_path, loopback, ring) as (station, _):
        station.await_records(FrameRecord, 5)
    kinds = [type(record) for record in station.records]
    assert kinds[0] is ConnectedRecord
    assert set(kinds[1:17]) == {LatchRecord}
    assert {record.epoch for record in station.records} == {1}


def test_a_silent_camera_is_set_up_from_scratch_when_the_recorder_asks(
    tmp_path: Path, loopback: Loopback, ring: CameraRing
) -> None:
    with _station(tmp_path, loopback, ring) as (station, scene):
        station.await_records(FrameRecord, 2)
        scene.inject(Fault(kind=FaultKind.FROZEN, camera="K2", duration_s=1.0))
        ring.request_reconnect()
        station.await_records(ConnectedRecord, 2)
        station.await_records(FrameRecord, 5)
    kinds = [type(record) for record in station.records]
    assert kinds.index(DisconnectedRecord) < len(kinds) - kinds[::-1].index(ConnectedRecord)
    assert max(record.epoch for record in station.records) == 2


def test_a_simulated_camera_stays_away_as_long_as_the_scenario_says(
    tmp_path: Path, loopback: Loopback, ring: CameraRing
) -> None:
    """The fault comes every 150 pulses, so that the camera meets one however late it is ready."""
    faults = [{"kind": "restart", "camera": "K2", "at_pulse": at, "duration_s": 3.0} for at in range(45, 2000, 150)]
    rig = make_rig(tmp_path, "sim", loopback, faults=faults)
    opener = camera_opener(rig, 1, ring, host_now())
    with Station(lambda _: opener(), ring) as station:
        station.await_records(ConnectedRecord, 2)
        taken = sum(isinstance(record, FrameRecord) for record in station.records)
        station.await_records(FrameRecord, taken + 3)
    frames = [record for record in station.records if isinstance(record, FrameRecord)]
    before = max(record.device_time for record in frames if record.epoch == 1)
    after = min(record.device_time for record in frames if record.epoch == 2)
    assert after - before > 3_000_000_000


def test_a_camera_that_delivers_is_left_alone_when_the_recorder_asks_too_late(
    tmp_path: Path, loopback: Loopback, ring: CameraRing
) -> None:
    with _station(tmp_path, loopback, ring) as (station, _):
        station.await_records(FrameRecord, 2)
        ring.request_reconnect()
        station.await_records(FrameRecord, 6)
    assert {record.epoch for record in station.records} == {1}


class NoticingCamera(SimCamera):
    """Reports a message once, after its first frame."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._to_tell = ["the bus was reset"]

    def notices(self) -> Sequence[str]:
        told, self._to_tell = self._to_tell, []
        return told


def test_what_a_camera_wants_people_to_know_is_passed_on_once(
    tmp_path: Path, loopback: Loopback, ring: CameraRing
) -> None:
    rig = make_rig(tmp_path, "sim", loopback)
    scene = SimScene(rig, 1, host_now())
    with Station(lambda it: NoticingCamera(rig.cameras[1], it, scene), ring) as station:
        station.await_records(FrameRecord, 3)
    notices = [record.text for record in station.records if isinstance(record, NoticeRecord)]
    assert notices == ["the bus was reset"]


def test_a_camera_that_is_not_there_is_tried_again_and_reported_once(ring: CameraRing) -> None:
    tried = threading.Semaphore(0)

    def fail(_: CameraRing) -> Camera:
        tried.release()
        raise CameraNotFoundError("camera K2 does not answer: check its cable")

    with Station(fail, ring) as station:
        for _ in range(3):
            assert tried.acquire(timeout=10)
        station.take()
    assert [(type(record), record.text) for record in station.records if isinstance(record, DisconnectedRecord)] == [
        (DisconnectedRecord, "camera K2 does not answer: check its cable")
    ]


def test_a_recorder_that_stands_still_loses_frames_but_they_are_counted(
    tmp_path: Path, loopback: Loopback, ring: CameraRing
) -> None:
    with _station(tmp_path, loopback, ring) as (station, _):
        station.await_records(FrameRecord, ring.slots, release=False)
        wait_until(lambda: ring.counters()["underruns"] > 0, "underruns are counted")
        for record in station.records:
            if isinstance(record, FrameRecord):
                ring.release(record.slot)
        station.await_records(FrameRecord, ring.slots + 3)
    ids = [record.frame_id for record in station.records if isinstance(record, FrameRecord)]
    assert ids == sorted(set(ids))
    assert ids[-1] - ids[0] > len(ids) - 1  # the ids show the hole
