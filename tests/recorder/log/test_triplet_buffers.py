import threading

import numpy as np
import pytest

from recorder.log.mcap_layout import PAGE
from recorder.log.triplet_buffers import TripletBuffers


@pytest.mark.parametrize("shape", [(24, 90), (480, 1920), (3, 1)])
def test_pixels_stand_on_pages_and_do_not_overlap(shape: tuple[int, int]) -> None:
    buffers = TripletBuffers(shape, 3)
    for slot in range(3):
        pixels = buffers.pixels(slot)
        assert pixels.shape == shape
        assert pixels.ctypes.data % PAGE == 0
        assert len(buffers.memory(slot)) % PAGE == 0
        pixels[:] = slot + 1
    assert [set(np.unique(buffers.pixels(slot))) for slot in range(3)] == [{1}, {2}, {3}]


def test_views_are_made_once() -> None:
    buffers = TripletBuffers((24, 90), 2)
    assert buffers.pixels(1) is buffers.pixels(1)
    assert buffers.memory(1) is buffers.memory(1)


def test_a_slot_is_free_again_when_the_last_holder_lets_go() -> None:
    buffers = TripletBuffers((24, 90), 1)
    slot = buffers.acquire()
    assert slot is not None
    assert buffers.acquire() is None
    buffers.hold(slot)
    buffers.release(slot)
    assert buffers.acquire() is None
    buffers.release(slot)
    assert buffers.free_count == 1
    assert buffers.acquire() == slot


def test_a_slot_can_be_waited_for() -> None:
    buffers = TripletBuffers((24, 90), 1)
    slot = buffers.acquire()
    assert slot is not None
    assert buffers.acquire(timeout_s=0.05) is None
    later = threading.Timer(0.05, buffers.release, (slot,))
    later.start()
    assert buffers.acquire(timeout_s=30.0) == slot
    later.join()


def test_holding_or_releasing_a_free_slot_is_refused() -> None:
    buffers = TripletBuffers((24, 90), 1)
    with pytest.raises(ValueError, match="slot 0 is free"):
        buffers.release(0)
    with pytest.raises(ValueError, match="slot 0 is free"):
        buffers.hold(0)
    assert buffers.free_count == 1


def test_counts_hold_under_many_threads() -> None:
    buffers = TripletBuffers((3, 1), 4)
    owners = [0] * 4
    wrong = []

    def work() -> None:
        for _ in range(2000):
            slot = buffers.acquire()
            if slot is None:
                continue
            owners[slot] += 1
            if owners[slot] != 1:
                wrong.append(slot)
            buffers.hold(slot)
            buffers.release(slot)
            owners[slot] -= 1
            buffers.release(slot)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert not wrong
    assert buffers.free_count == 4


def test_memory_outlives_close_as_long_as_somebody_looks_at_it() -> None:
    buffers = TripletBuffers((24, 90), 1)
    pixels = buffers.pixels(0)
    pixels[:] = 9
    buffers.close()
    assert pixels.sum() == 9 * 24 * 90
