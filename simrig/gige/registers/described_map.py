"""A camera with the description of another: its bootstrap registers are our own, all others are memory.

A description (GenICam XML) names registers at any address. What the other camera does with them nobody knows here; what
is written there is read there, except where the description says that it can only be read.
"""

from collections.abc import Callable, Iterable
from typing import Final
from xml.etree import ElementTree as ET

from simrig.gige.protocol.gvcp import Status
from simrig.gige.registers.register_map import WORD, Register, RegisterError, RegisterMap

#: Where our own registers end that every camera has, and where the description lies.
BOOTSTRAP_END: Final = 0x10000
DESCRIPTION_ADDRESS: Final = 0xE000_0000
_REGISTERS: Final = frozenset({"IntReg", "MaskedIntReg", "FloatReg", "StringReg", "Register", "StructReg"})


class DescribedMap(RegisterMap):
    """See above.

    Args:
        registers: our own.
        description: the XML, padded to a multiple of 4 bytes.

    Attributes:
        made: whether the camera is as its maker has made it: before, everything may be written.
        refuses: whether it refuses to have an address written in its present state; its description says so at best.
    """

    def __init__(self, registers: Iterable[Register], description: bytes) -> None:
        super().__init__(registers, {DESCRIPTION_ADDRESS: description})
        self._others: dict[int, bytes] = {}
        self._read_only = _read_only(description)
        self.made = False
        self.refuses: Callable[[int], bool] = lambda _: False

    def read(self, address: int, count: int) -> bytes:
        """See `RegisterMap.read`."""
        if address >= DESCRIPTION_ADDRESS or self._ours(address):
            return super().read(address, count)
        words = range(address - address % WORD, address + count, WORD)
        data = b"".join(self._others.get(word, b"\0" * WORD) for word in words)
        return data[address % WORD :][:count].ljust(count, b"\0")

    def write(self, address: int, data: bytes) -> None:
        """See `RegisterMap.write`."""
        if self._ours(address):
            super().write(address, data)
            return
        if self.made and (address in self._read_only or self.refuses(address)):
            raise RegisterError(Status.WRITE_PROTECT)
        for place in range(0, len(data), WORD):
            self._others[address + place] = data[place : place + WORD].ljust(WORD, b"\0")

    def _ours(self, address: int) -> bool:
        return address < BOOTSTRAP_END and address - address % WORD in self._at


def _read_only(description: bytes) -> frozenset[int]:
    """Addresses that can only be read, as far as they stand in the description as numbers."""
    read, written = set[int](), set[int]()
    for element in ET.fromstring(description.rstrip()).iter():  # noqa: S314 - a file that its owner has given us
        kind = element.tag.rpartition("}")[2]
        children = {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in element}
        if kind in _REGISTERS and "Address" in children and "pAddress" not in children:
            (read if children.get("AccessMode") == "RO" else written).add(int(children["Address"], 0))
    return frozenset(read - written)
