"""CRC-32 of bytes that are put together from parts whose CRC-32 is known: no byte is read a second time.

Appending zero bytes to what a CRC-32 covers changes it by a linear map over GF(2). The CRC-32 of two parts is that of
the first, so changed by the length of the second, XOR that of the second. The maps for 1, 2, 4, ... zero bytes are made
once, as tables by byte, so that any length takes a few look-ups.
"""

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

_POLYNOMIAL: Final = 0xEDB88320  # CRC-32 as in zlib: x^32 + x^26 + ... + 1, lowest power in the highest bit

#: For each byte of a CRC (lowest first), what each of its 256 values becomes.
_Tables = tuple[list[int], list[int], list[int], list[int]]


def combined_crc(first: int, second: int, length: int) -> int:
    """CRC-32 of two parts, one after the other.

    Args:
        first: CRC-32 of the first part.
        second: CRC-32 of the second part.
        length: bytes of the second part.
    """
    power = 0
    while length:
        if length & 1:
            a, b, c, d = _zeros(power)
            first = a[first & 0xFF] ^ b[first >> 8 & 0xFF] ^ c[first >> 16 & 0xFF] ^ d[first >> 24]
        length >>= 1
        power += 1
    return first ^ second


@cache
def _zeros(power: int) -> _Tables:
    """What 2**`power` zero bytes do to a CRC."""
    a, b, c, d = (_spread(columns) for columns in np.split(_columns(power), 4))
    return a.tolist(), b.tolist(), c.tolist(), d.tolist()


@cache
def _columns(power: int) -> NDArray[np.uint32]:
    """The map as a matrix: what becomes of each of the 32 bits of a CRC."""
    bits = np.left_shift(np.uint32(1), np.arange(32, dtype=np.uint32))
    if power == 0:
        for _ in range(8):
            bits = np.where(bits & 1, bits >> 1 ^ np.uint32(_POLYNOMIAL), bits >> 1).astype(np.uint32)
        return bits
    half = _columns(power - 1)  # twice the half
    tables = [_spread(columns) for columns in np.split(half, 4)]
    twice = [table[half >> 8 * place & 0xFF] for place, table in enumerate(tables)]
    together: NDArray[np.uint32] = np.bitwise_xor.reduce(twice)
    return together


def _spread(columns: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """What becomes of each value of a byte, from what becomes of its 8 bits."""
    values = np.arange(256, dtype=np.uint32)
    parts = [np.where(values >> bit & 1, column, np.uint32(0)) for bit, column in enumerate(columns)]
    together: NDArray[np.uint32] = np.bitwise_xor.reduce(parts)
    return together
