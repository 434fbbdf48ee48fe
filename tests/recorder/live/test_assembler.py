"""The assembler with real rings and real buffers: right columns, black blocks, back-pressure without loss."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recorder.live.assembler import Assembler, least_buffers
from recorder.live.composer import Triplet
from recorder.live.tagging import Tagger
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import HostNs, UtcAnchor, host_now
from rig.frame import FrameStatus
from rig.phrase import plain
from rig.transport.recorder_reports import CameraNews
from tests.recorder.live.ring_cameras import PERIOD, SIZES, START, RingCameras, camera_rings, grey, ring_rig

Parts = tuple[Assembler, RingCameras, TripletBuffers]


@pytest.fixture
def parts() -> Iterator[Parts]:
    rig = ring_rig()
    with camera_rings(rig) as rings:
        buffers = TripletBuffers(rig.triplet_shape, 4)
        yield Assembler(rig, rings, buffers), RingCameras(rings), buffers
        buffers.close()


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


def test_frames_stand_side_by_side_in_the_rigs_order(parts: Parts) -> None:
    assembler, cameras, buffers = parts
    cameras.expose(1, 2, 0, 1)
    (triplet,) = assembler.pump(_now(1.3))
    assert _blocks(buffers, triplet) == [{10}, {11}, {12}]
    assert all(ring.counters()["slots_queued"] == 0 for ring in cameras.rings)
    tags = list(Tagger(assembler.rig, UtcAnchor(0), "", "").camera_tags(triplet.pulse))
    assert [(tag.columns, tag.status) for tag in tags] == [
        ((0, 40), FrameStatus.OK), ((40, 104), FrameStatus.OK), ((104, 120), FrameStatus.OK),
    ]  # fmt: skip
    assert [tag.offset_us for tag in tags] == [-0.001, 0.0, 0.001]


def test_only_a_camera_that_was_there_can_be_gone(parts: Parts) -> None:
    assembler, cameras, _ = parts
    assembler.cameras.disconnected(1, plain("does not answer"), _now(0))
    cameras.expose(1, 0)
    list(assembler.pump(_now(1.3)))
    assembler.cameras.disconnected(0, plain("unplugged"), _now(2))
    told = [(change.camera, change.news, change.event("K").message) for change in assembler.cameras.changes()]
    assert (1, CameraNews.ABSENT, "absent: does not answer") in told
    assert told[-1] == (0, CameraNews.GONE, "gone: unplugged")


def test_a_missing_frame_is_black_even_where_an_older_one_stood(
    parts: Parts,
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
    parts: Parts,
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


def test_buffers_that_become_free_go_to_the_pulse_that_has_waited_longest(
    parts: Parts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk frees buffers while frames are read: later pulses must not take them all, and wait behind the first."""
    assembler, cameras, buffers = parts
    acquire = buffers.acquire
    at_the_disk = [slot for _ in range(4) if (slot := acquire()) is not None]

    def acquire_just_before_they_are_free() -> int | None:
        slot = acquire()
        if slot is None:
            while at_the_disk:
                buffers.release(at_the_disk.pop())
        return slot

    monkeypatch.setattr(buffers, "acquire", acquire_just_before_they_are_free)
    cameras.expose(1, 0, 2)
    for pulse in range(2, 7):
        cameras.expose(pulse, 0, 1, 2)
    numbers = []
    for now in range(6, 60):
        for triplet in assembler.pump(_now(now)):
            numbers.append(triplet.pulse.number)
            _blocks(buffers, triplet)
    assert numbers == [1, 2, 3, 4, 5, 6]
    assert not assembler.backlog


@pytest.mark.parametrize("lost", [(1,), (1, 2, 3), (3, 4, 9), tuple(range(1, 18))])
def test_pulses_that_one_camera_alone_has_do_not_wait_for_the_buffers_of_later_ones(lost: tuple[int, ...]) -> None:
    """The recorder was held up and reads the cameras one after the other: the last one has pulses that others lost."""
    rig, last = ring_rig(), 40
    with camera_rings(rig, slots=64) as rings:
        buffers = TripletBuffers(rig.triplet_shape, least_buffers(rig.trigger.period_ns))
        assembler, cameras = Assembler(rig, rings, buffers), RingCameras(rings)
        for pulse in range(1, last + 1):
            cameras.latch(pulse)
            for camera in range(3):
                cameras.expose(pulse, camera, lose=pulse in lost and camera < 2)
        seen: dict[int, list[set[int]]] = {}
        for _ in range(200):
            for triplet in assembler.pump(_now(last + 1)):
                seen[triplet.pulse.number] = _blocks(buffers, triplet)
        assert buffers.free_count == buffers.count
        buffers.close()
    whole = {n: [{grey(n, camera)} for camera in range(3)] for n in range(1, last + 1)}
    assert seen == {n: [{0}, {0}, blocks[2]] if n in lost else blocks for n, blocks in whole.items()}


@given(st.data())
@settings(max_examples=40, deadline=None)
def test_whatever_is_lost_and_however_slow_the_disk_every_pulse_is_handed_on(data: st.DataObject) -> None:
    """Frames lost at random, a recorder that is held up at random, a disk that frees buffers at random."""
    rig, last = ring_rig(), 60
    numbers = st.sets(st.integers(1, last - 1), max_size=30)
    lost = [data.draw(numbers, label=f"lost by camera {camera}") for camera in range(3)]
    held_up = data.draw(numbers, label="pulses at which the recorder does nothing")
    busy = data.draw(numbers, label="pulses at which the disk frees nothing")
    with camera_rings(rig, slots=last + 4) as rings:
        buffers = TripletBuffers(rig.triplet_shape, least_buffers(rig.trigger.period_ns))
        assembler, cameras = Assembler(rig, rings, buffers), RingCameras(rings)
        at_the_disk: list[Triplet] = []
        seen: dict[int, list[set[int]]] = {}
        for pulse in range(1, last + 60):
            if pulse <= last:
                cameras.latch(pulse)
                for camera in range(3):
                    cameras.expose(pulse, camera, lose=pulse in lost[camera])
            if pulse not in held_up:
                at_the_disk += assembler.pump(_now(pulse + 0.3))
            if pulse not in busy:
                for triplet in at_the_disk:
                    if triplet.slot is not None:
                        at = round((triplet.pulse.time - START) / PERIOD)
                        seen[at] = _blocks(buffers, triplet)
                at_the_disk = []
        assert not assembler.backlog
        assert buffers.free_count == buffers.count
        buffers.close()
    unseen = lost[0] & lost[1] & lost[2]
    assert seen == {
        n: [{0} if n in lost[camera] else {grey(n, camera)} for camera in range(3)]
        for n in range(1, last + 1) if n not in unseen
    }  # fmt: skip


def test_a_recorder_that_takes_anothers_place_goes_on_with_its_cameras() -> None:
    rig = ring_rig()
    with camera_rings(rig) as rings:
        cameras, first = RingCameras(rings, host_now()), TripletBuffers(rig.triplet_shape, 1)
        dead = Assembler(rig, rings, first)
        for pulse in (1, 2, 3):
            cameras.expose(pulse, 0, 1, 2)
        dead.pump(cameras.time(3.3))  # pulse 1 has the only buffer; it dies with pulse 2 in hand, 3 unread
        first.close()
        in_hand = [ring.queued_slots() - ring.unread_slots() for ring in rings]
        assert [len(slots) for slots in in_hand] == [1, 1, 1]

        buffers = TripletBuffers(rig.triplet_shape, 4)
        anew = Assembler(rig, rings, buffers)
        anew.pump(cameras.time(3.4))
        assert [change.news for change in anew.cameras.changes()] == [CameraNews.CONNECTED] * 3
        assert anew.cameras.connected == [True] * 3
        cameras.latch()
        cameras.expose(4, 0, 1, 2)
        (triplet,) = anew.pump(cameras.time(4.3))
        assert _blocks(buffers, triplet) == [{40}, {41}, {42}]
        assert [ring.queued_slots() for ring in rings] == in_hand, "a grabber could still be about to queue them"
        anew.pump(HostNs(host_now() + 2_000_000_000))
        assert [ring.queued_slots() for ring in rings] == [set()] * 3
        buffers.close()


def test_a_slot_whose_record_was_just_being_queued_is_not_taken_for_stranded() -> None:
    rig = ring_rig()
    with camera_rings(rig) as rings:
        slot = rings[0].take_slot()
        assert slot is not None
        rings[0]._map[1024 + slot] = 2  # queued; its record follows only after the new recorder has looked
        buffers = TripletBuffers(rig.triplet_shape, 4)
        assembler, cameras = Assembler(rig, rings, buffers), RingCameras(rings, host_now())
        assembler.pump(cameras.time(0))
        rings[0]._map[1024 + slot] = 0
        cameras.expose(1, 0, 1, 2)
        later = HostNs(host_now() + 2_000_000_000)
        taken = [buffers.acquire() for _ in range(4)]  # nothing is copied now: the frames stay in their slots
        assembler.pump(later)
        assert [len(ring.queued_slots()) for ring in rings] == [1, 1, 1]
        for held in taken:
            assert held is not None
            buffers.release(held)
        buffers.close()
