"""The assembler with real rings and real buffers: right columns, black blocks, back-pressure without loss."""

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from recorder.assembler import Assembler, Triplet
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import DeviceNs, HostNs, UtcAnchor
from rig.frame import FrameStatus, Record, RecordKind
from rig.ring import CameraRing
from rig.settings import CameraSettings, Region, RigSettings, TriggerSettings

PERIOD = 33_333_333
SIZES = [(40, 30), (64, 30), (16, 30)]
START = 1_000_000_000


def _rig() -> RigSettings:
    cameras = tuple(
        CameraSettings(name=f"K{i + 1}", backend="aravis", address=f"127.0.0.{i + 1}", region=Region(width=w, height=h))
        for i, (w, h) in enumerate(SIZES)
    )
    return RigSettings(name="test", cameras=cameras, trigger=TriggerSettings(rate_hz=30))


class Cameras:
    """Three grabbers' ends of their rings; every device clock is the host's."""

    def __init__(self, rings: list[CameraRing]) -> None:
        self.rings = rings
        self.ids = [0] * len(rings)
        for ring in rings:
            ring.put(Record(RecordKind.CONNECTED, 1, HostNs(START - 1)))
            for i in range(16):
                time = HostNs(START - 16 + i)
                ring.put(Record(RecordKind.LATCH, 1, time, device_time=DeviceNs(time), value=10_000))

    def expose(self, pulse: int, *cameras: int, lose: bool = False) -> None:
        """Put one frame of each camera; its pixels are 10 * pulse + camera."""
        for camera in cameras:
            self.ids[camera] += 1
            slot = None if lose else self.rings[camera].take_slot()
            if slot is None:
                continue
            self.rings[camera].frame(slot)[:] = 10 * pulse + camera
            time = START + pulse * PERIOD
            record = Record(
                RecordKind.FRAME, 1, HostNs(time + 5_000_000), slot, self.ids[camera], 0, DeviceNs(time + camera)
            )
            self.rings[camera].put(record)


@pytest.fixture
def parts() -> Iterator[tuple[Assembler, Cameras, TripletBuffers]]:
    rig = _rig()
    with ExitStack() as stack:
        rings = []
        for camera in rig.cameras:
            rings.append(CameraRing.create(camera.name, camera.frame_bytes, 16))
            stack.callback(rings[-1].close)
        buffers = TripletBuffers(rig.triplet_shape, 4)
        stack.callback(buffers.close)
        yield Assembler(rig, rings, buffers), Cameras(rings), buffers


def _now(pulse: float) -> HostNs:
    return HostNs(START + round(pulse * PERIOD))


def _blocks(buffers: TripletBuffers, triplet: Triplet) -> list[set[int]]:
    """The grey values in each camera's block; the buffer is released."""
    assert triplet.slot is not None
    pixels, first, values = buffers.pixels(triplet.slot), 0, []
    for width, _ in SIZES:
        values.append(set(np.unique(pixels[:, first : first + width]).tolist()))
        first += width
    buffers.release(triplet.slot)
    return values


def test_frames_stand_side_by_side_in_the_rigs_order(parts: tuple[Assembler, Cameras, TripletBuffers]) -> None:
    assembler, cameras, buffers = parts
    cameras.expose(1, 2, 0, 1)
    (triplet,) = assembler.pump(_now(1.3))
    assert _blocks(buffers, triplet) == [{10}, {11}, {12}]
    assert all(ring.counters()["slots_queued"] == 0 for ring in cameras.rings)
    tags = assembler.camera_tags(triplet.pulse, UtcAnchor(0))
    assert [(tag.columns, tag.status) for tag in tags] == [
        ((0, 40), FrameStatus.OK), ((40, 104), FrameStatus.OK), ((104, 120), FrameStatus.OK),
    ]  # fmt: skip
    assert [tag.offset_us for tag in tags] == [-0.001, 0.0, 0.001]


def test_a_missing_frame_is_black_even_where_an_older_one_stood(
    parts: tuple[Assembler, Cameras, TripletBuffers],
) -> None:
    assembler, cameras, buffers = parts
    for pulse in range(1, 5):
        cameras.expose(pulse, 0, 1, 2)
    assert [len(_blocks(buffers, triplet)) for triplet in assembler.pump(_now(4.3))] == [3] * 4
    cameras.expose(5, 0, 2)
    cameras.expose(5, 1, lose=True)
    cameras.expose(6, 0, 1, 2)
    lost, complete = assembler.pump(_now(6.3))
    assert [outcome.status for outcome in lost.pulse.outcomes] == [FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK]
    assert _blocks(buffers, lost) == [{50}, {0}, {52}]
    assert _blocks(buffers, complete) == [{60}, {61}, {62}]


def test_without_a_free_buffer_frames_wait_in_the_rings_and_none_is_lost(
    parts: tuple[Assembler, Cameras, TripletBuffers],
) -> None:
    assembler, cameras, buffers = parts
    for pulse in range(1, 11):
        cameras.expose(pulse, 0, 1, 2)
    numbers: list[int] = []
    seen: list[list[set[int]]] = []
    for _ in range(40):
        for triplet in assembler.pump(_now(10.3)):
            numbers.append(triplet.pulse.number)
            seen.append(_blocks(buffers, triplet))
    assert numbers == list(range(1, 11))
    assert seen == [[{10 * n}, {10 * n + 1}, {10 * n + 2}] for n in range(1, 11)]
    assert not assembler.backlog
    assert buffers.free_count == buffers.count
