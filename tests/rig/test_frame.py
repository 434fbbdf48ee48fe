import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import DeviceNs, HostNs
from rig.frame import NO_SLOT, RECORD_BYTES, TEXT_BYTES, Record, RecordKind, StampedPixels

INT64 = st.integers(-(2**63), 2**63 - 1)
records = st.builds(
    Record,
    kind=st.sampled_from(RecordKind),
    epoch=st.integers(0, 2**32 - 1),
    host_time=INT64.map(HostNs),
    slot=st.integers(0, NO_SLOT),
    frame_id=st.integers(0, 2**64 - 1),
    id_modulus=st.integers(0, 2**32 - 1),
    device_time=INT64.map(DeviceNs),
    trigger_count=INT64,
    value=INT64,
    text=st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=TEXT_BYTES // 4),
)


@given(records, st.integers(0, 3))
def test_what_is_packed_is_unpacked(record: Record, place: int) -> None:
    buffer = bytearray(b"\xaa" * (RECORD_BYTES * 4))
    record.pack_into(memoryview(buffer), place * RECORD_BYTES)
    assert Record.unpack_from(memoryview(buffer), place * RECORD_BYTES) == record
    others = buffer[: place * RECORD_BYTES] + buffer[(place + 1) * RECORD_BYTES :]
    assert set(others) == {0xAA}


@given(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), min_size=TEXT_BYTES))
def test_a_long_text_is_cut_between_characters(text: str) -> None:
    buffer = bytearray(RECORD_BYTES)
    Record(RecordKind.DISCONNECTED, 1, HostNs(5), text=text).pack_into(memoryview(buffer), 0)
    kept = Record.unpack_from(memoryview(buffer), 0).text
    assert text.startswith(kept)
    assert TEXT_BYTES - 4 < len(kept.encode()) <= TEXT_BYTES


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="RecordKind"):
        Record.unpack_from(memoryview(bytes(RECORD_BYTES)), 0)


@given(st.integers(0, 16383), st.integers(0, 16383), st.integers(1, 16384))
def test_stamped_pixels_travel_as_one_number(row: int, column: int, count: int) -> None:
    pixels = StampedPixels(row, column, count)
    assert StampedPixels.from_value(pixels.to_value()) == pixels
    assert pixels.to_value() < 2**63


def test_no_number_means_no_stamped_pixels() -> None:
    assert StampedPixels.from_value(0) is None
