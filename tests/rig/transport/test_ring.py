"""The camera ring: ownership of slots, order of records, take-over after a crash, across real processes."""

import os
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import DeviceNs, HostNs
from rig.errors import BadInputError
from rig.frame import FrameRecord
from rig.transport.ring import CameraRing


def _record(slot: int = 0, frame_id: int = 0) -> FrameRecord:
    return FrameRecord(HostNs(5), slot, frame_id, 0, DeviceNs(0), epoch=1)


def _ids(ring: CameraRing) -> list[int]:
    """Ids of the frames that are queued; there are no other records."""
    records = list(iter(ring.get, None))
    frames = [record for record in records if isinstance(record, FrameRecord)]
    assert len(frames) == len(records)
    return [frame.frame_id for frame in frames]


@pytest.fixture
def ring() -> Iterator[CameraRing]:
    made = CameraRing.create("K1", 1000, 4, queue=8)
    yield made
    made.close()


def test_lowest_free_slot_is_taken_first(ring: CameraRing) -> None:
    assert [ring.take_slot() for _ in range(5)] == [0, 1, 2, 3, None]
    for slot in (3, 1):
        ring.put(_record(slot), 1)
        ring.release(slot)
    assert ring.take_slot() == 1


def test_records_come_in_order_and_a_full_queue_is_counted(ring: CameraRing) -> None:
    assert [ring.put(_record(frame_id=i), 1) for i in range(9)] == [True] * 8 + [False]
    assert ring.counters()["queue_overflows"] == 1
    assert _ids(ring) == list(range(8))
    assert ring.put(_record(frame_id=99), 1)
    assert ring.get() == _record(frame_id=99)


@given(st.lists(st.booleans(), max_size=200))
def test_any_interleaving_keeps_order_and_loses_nothing(puts: list[bool]) -> None:
    ring = CameraRing.create("K1", 10, 2, queue=5)
    sent: list[int] = []
    got: list[int] = []
    for number, is_put in enumerate(puts):
        if is_put:
            if ring.put(_record(frame_id=number), 1):
                sent.append(number)
        elif isinstance(record := ring.get(), FrameRecord):
            got.append(record.frame_id)
    got += _ids(ring)
    ring.close()
    assert got == sent


def test_a_new_grabber_takes_over_what_the_dead_one_held_but_not_what_is_queued(ring: CameraRing) -> None:
    queued, held = ring.take_slot(), ring.take_slot()
    assert (queued, held) == (0, 1)
    ring.put(_record(0), 1)
    ring.reclaim()
    assert ring.take_slot() == 1
    assert ring.counters()["slots_queued"] == 1


def test_another_process_sees_pixels_and_records() -> None:
    ring = CameraRing.create("K1", 640, 4)
    program = f"""
from rig.transport.ring import CameraRing
from tests.rig.transport.test_ring import _record
ring = CameraRing({ring.fd})
slot = ring.take_slot()
ring.frame(slot)[:] = 7
ring.put(_record(slot, 42), 1)
"""
    subprocess.run([sys.executable, "-c", program], pass_fds=(ring.fd,), check=True, timeout=20)
    record = ring.get()
    assert record == _record(0, 42)
    assert np.all(ring.frame(0) == 7)
    ring.close()


def test_slots_lie_where_the_address_says(ring: CameraRing) -> None:
    for slot in range(ring.slots):
        assert ring.frame(slot).ctypes.data == ring.slot_address(slot)
        assert ring.slot_address(slot) % os.sysconf("SC_PAGESIZE") == 0


def test_a_descriptor_that_is_no_ring_is_refused() -> None:
    fd = os.memfd_create("other")
    os.ftruncate(fd, 4096)
    with pytest.raises(BadInputError, match="no camera ring"):
        CameraRing(fd)
    os.close(fd)


@pytest.mark.parametrize("slots", [1, 5000])
def test_absurd_slot_counts_are_refused(slots: int) -> None:
    with pytest.raises(BadInputError, match="ring_s"):
        CameraRing.create("K1", 10, slots)
