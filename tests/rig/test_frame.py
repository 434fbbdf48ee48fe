import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import (
    RECORD_BYTES,
    TEXT_BYTES,
    ConnectedRecord,
    DamagedRecord,
    DisconnectedRecord,
    FrameRecord,
    LatchRecord,
    LimitsRecord,
    NoticeRecord,
    Record,
    StampedPixels,
    pack_into,
    unpack_from,
)

INT64 = st.integers(-(2**63), 2**63 - 1)
HOST, DEVICE, EPOCH = INT64.map(HostNs), INT64.map(DeviceNs), st.integers(0, 2**32 - 1)
TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=TEXT_BYTES // 4)
pixels = st.builds(StampedPixels, st.integers(0, 16383), st.integers(0, 16383), st.integers(1, 16384))
records = st.one_of(
    st.builds(
        FrameRecord, HOST, slot=st.integers(0, 2**32 - 1), frame_id=st.integers(0, 2**64 - 1),
        id_modulus=st.integers(0, 2**32 - 1), device_time=DEVICE, trigger_count=INT64,
        stamped=st.one_of(st.none(), pixels), epoch=EPOCH,
    ),
    st.builds(DamagedRecord, HOST, st.one_of(st.none(), DEVICE), EPOCH),
    st.builds(LatchRecord, st.builds(ClockLatch, DEVICE, HOST, INT64), EPOCH),
    *(st.builds(made, HOST, TEXT, EPOCH) for made in (ConnectedRecord, DisconnectedRecord, NoticeRecord, LimitsRecord)),
)  # fmt: skip


@given(records, st.integers(0, 3))
def test_what_is_packed_is_unpacked(record: Record, place: int) -> None:
    buffer = bytearray(b"\xaa" * (RECORD_BYTES * 4))
    pack_into(record, record.epoch, memoryview(buffer), place * RECORD_BYTES)
    assert unpack_from(memoryview(buffer), place * RECORD_BYTES) == record
    others = buffer[: place * RECORD_BYTES] + buffer[(place + 1) * RECORD_BYTES :]
    assert set(others) == {0xAA}


@given(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), min_size=TEXT_BYTES))
def test_a_long_text_is_cut_between_characters(text: str) -> None:
    buffer = bytearray(RECORD_BYTES)
    pack_into(DisconnectedRecord(HostNs(5), text), 1, memoryview(buffer), 0)
    kept = unpack_from(memoryview(buffer), 0)
    assert isinstance(kept, DisconnectedRecord)
    assert text.startswith(kept.text)
    assert TEXT_BYTES - 4 < len(kept.text.encode()) <= TEXT_BYTES


def test_a_record_is_of_the_connection_under_which_it_was_queued() -> None:
    buffer = bytearray(RECORD_BYTES)
    pack_into(DamagedRecord(HostNs(5)), 7, memoryview(buffer), 0)
    assert unpack_from(memoryview(buffer), 0) == DamagedRecord(HostNs(5), epoch=7)


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="_Kind"):
        unpack_from(memoryview(bytes(RECORD_BYTES)), 0)


@given(st.integers(0, 16383), st.integers(0, 16383), st.integers(1, 16384))
def test_stamped_pixels_travel_as_one_number(row: int, column: int, count: int) -> None:
    pixels = StampedPixels(row, column, count)
    assert StampedPixels.from_value(pixels.to_value()) == pixels
    assert pixels.to_value() < 2**63


def test_no_number_means_no_stamped_pixels() -> None:
    assert StampedPixels.from_value(0) is None
