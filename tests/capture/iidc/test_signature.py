"""Signatures: both byte orders, wraps, torn frames, stalls."""

import struct

from hypothesis import assume, given
from hypothesis import strategies as st

from capture.iidc.clock import WRAP_NS
from capture.iidc.signature import ByteOrder, SignatureReader

_BYTES = 12  # of AVT's signature

DELAY_NS = 20_000_000
PERIOD_NS = 33_333_333


def word_at(ns: int) -> int:
    """What the cycle timer shows, as its definition says."""
    ticks = ns % WRAP_NS * 384 // 15625
    return ticks // 24_576_000 << 25 | ticks // 3072 % 8000 << 12 | ticks % 3072


def stamp(order: ByteOrder, trigger_ns: int, frames: int, triggers: int) -> bytes:
    return struct.pack(f"{order.value}III", word_at(trigger_ns), frames, triggers)


times = st.integers(WRAP_NS, 10**15)
orders = st.sampled_from(ByteOrder)
counts = st.integers(1, 1 << 24)


@given(times, orders, counts, st.integers(0, 1000), st.integers(0, DELAY_NS), st.integers(0, 6))
def test_a_signature_is_read_whatever_its_order_and_however_long_the_frame_waited(
    trigger: int, order: ByteOrder, frames: int, overruns: int, delay: int, stalls: int
) -> None:
    """The kernel's time of a packet that waited long is wrong by a multiple of 8 s; the trigger time is right."""
    reader = SignatureReader(DELAY_NS, order)
    found = reader.read(stamp(order, trigger, frames, frames + overruns), trigger + delay + stalls * 8_000_000_000)
    assert found is not None
    assert (found.frames, found.triggers) == (frames, frames + overruns)
    assert abs(found.trigger_ns - trigger) <= 41  # one tick


@given(times, orders, st.lists(st.integers(1, 5), min_size=3, max_size=20))
def test_the_byte_order_is_found_and_kept(start: int, order: ByteOrder, steps: list[int]) -> None:
    reader = SignatureReader(DELAY_NS)
    time, frames = start, 0
    for step in steps:
        time, frames = time + step * PERIOD_NS, frames + step
        found = reader.read(stamp(order, time, frames, frames), time + 2_500_000)
        assert found is not None
        assert (found.frames, abs(found.trigger_ns - time) <= 41) == (frames, True)
    assert reader.order is order


@given(times, orders)
def test_times_go_on_across_the_wrap(start: int, order: ByteOrder) -> None:
    first = start // WRAP_NS * WRAP_NS - PERIOD_NS
    reader = SignatureReader(DELAY_NS, order)
    found = [
        reader.read(stamp(order, first + k * PERIOD_NS, k + 1, k + 1), first + k * PERIOD_NS + 2_500_000)
        for k in range(3)
    ]
    assert [signature.frames for signature in found if signature is not None] == [1, 2, 3]
    assert all(s is not None and abs(s.trigger_ns - first - k * PERIOD_NS) <= 41 for k, s in enumerate(found))


@given(times, orders, st.binary(min_size=_BYTES, max_size=_BYTES))
def test_pixels_are_no_signature(time: int, order: ByteOrder, pixels: bytes) -> None:
    """A torn frame has pixels where the signature should be."""
    reader = SignatureReader(DELAY_NS, order)
    assert reader.read(stamp(order, time, 7, 7), time + 2_500_000)
    nearby = abs(struct.unpack(f"{order.value}I", pixels[:4])[0] - word_at(time + PERIOD_NS)) < 1 << 20
    assume(not nearby)
    assert reader.read(pixels, time + PERIOD_NS + 2_500_000) is None


@given(times, orders, st.integers(1, 2))
def test_one_torn_frame_does_not_disturb_the_next(time: int, order: ByteOrder, torn: int) -> None:
    reader = SignatureReader(DELAY_NS)
    assert reader.read(stamp(order, time, 1, 1), time + 2_500_000)
    for k in range(torn):
        assert reader.read(b"\x15" * _BYTES, time + (k + 1) * PERIOD_NS + 2_500_000) is None
    later = time + (torn + 1) * PERIOD_NS
    found = reader.read(stamp(order, later, torn + 2, torn + 2), later + 2_500_000)
    assert found is not None
    assert found.frames == torn + 2


@given(times, orders, st.integers(1, 1 << 20), st.integers(0, 1 << 20))
def test_the_same_or_an_older_frame_is_refused(time: int, order: ByteOrder, frames: int, back: int) -> None:
    reader = SignatureReader(DELAY_NS, order)
    assert reader.read(stamp(order, time, frames, frames), time + 2_500_000)
    later = time + PERIOD_NS
    assert reader.read(stamp(order, later, max(0, frames - back), frames), later + 2_500_000) is None


@given(times, orders, st.integers(100, 1 << 20))
def test_a_camera_that_began_anew_is_believed_after_three_frames(time: int, order: ByteOrder, before: int) -> None:
    reader = SignatureReader(DELAY_NS, order)
    assert reader.read(stamp(order, time, before, before), time + 2_500_000)
    found = [
        reader.read(stamp(order, time + k * PERIOD_NS, k, k), time + k * PERIOD_NS + 2_500_000) for k in range(1, 6)
    ]
    assert [signature is not None for signature in found] == [False, False, False, True, True]
