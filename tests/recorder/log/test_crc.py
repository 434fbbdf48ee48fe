"""CRC-32 of parts that are put together: what zlib says of the whole."""

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recorder.log.crc import combined_crc


@given(first=st.binary(max_size=100), second=st.binary(max_size=300))
def test_parts_give_the_crc_of_the_whole(first: bytes, second: bytes) -> None:
    assert combined_crc(zlib.crc32(first), zlib.crc32(second), len(second)) == zlib.crc32(first + second)


@pytest.mark.parametrize("length", [1 << 12, 480 * 1920, (1 << 22) + 12345])
def test_long_parts(length: int) -> None:
    second = bytes(range(251)) * (length // 251 + 1)
    second = second[:length]
    assert combined_crc(zlib.crc32(b"first"), zlib.crc32(second), length) == zlib.crc32(b"first" + second)


def test_more_bytes_than_fit_into_memory() -> None:
    """In steps of a terabyte, as in one."""
    terabyte = 1 << 40
    once = combined_crc(zlib.crc32(b"x"), 0, terabyte)
    assert combined_crc(combined_crc(once, 0, terabyte), 0, terabyte) == combined_crc(zlib.crc32(b"x"), 0, 3 * terabyte)
