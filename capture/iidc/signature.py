"""Reads what cameras write into a frame, AVT's secure image signature: its trigger time, and whether it is torn.

The first twelve bytes of the last line are three words: the cycle time of the bus when the exposure began, the count
of frames read out, the count of triggers seen. Cameras differ in the order of the bytes in a word, and where pixels
have 16 bits, the manual leaves open whether the twelve stand one behind the other or one in each pixel ("the very first
4 bytes/pixels of a line"). The reader tries all and compares the time with the cycle timer of the bus.

libdc1394 on Linux does not report a frame that has lost a packet: everything behind the gap has moved up, and the
frame's end is the beginning of the next frame. Then the signature is not where it should be: so torn frames are found.

Point Grey's frame information is read likewise: two words, without triggers, in the first pixels of the frame. What is
torn behind them is not found, but the frame that vanished is, by the count.
"""

import struct
from dataclasses import dataclass
from enum import Enum
from itertools import product
from typing import Final

from capture.iidc.clock import CYCLE_NS, CycleTime, unwrap
from rig.clocks import NS_PER_S

_WORD_BYTES: Final = 4

#: The kernel's time stamps of packets have three bits of seconds only.
_PACKET_WRAP_NS: Final = 8 * NS_PER_S
#: After this many refusals in a row the last accepted frame was misread, or the camera was reset: forget it.
_MOST_REFUSALS: Final = 3
#: A signature that counts more frames or triggers than this since the last frame is none.
_MOST_STEPS: Final = 1 << 16


class ByteOrder(Enum):
    """Order of the bytes of a word."""

    BIG = ">"
    LITTLE = "<"


class Places(Enum):
    """Where in a line the bytes of the signature are: first one, and step to the next."""

    TOGETHER = 0, 1
    HIGH = 0, 2  #: the higher byte of each 16-bit pixel, which is sent first
    LOW = 1, 2  #: the lower byte of each 16-bit pixel

    def of(self, line: bytes, count: int) -> bytes:
        """The bytes of the signature, of which there are so many."""
        first, step = self.value
        return line[first::step][:count]


@dataclass(frozen=True, slots=True)
class Signature:
    """What the signature of a frame says.

    Attributes:
        trigger_ns: when its exposure began, unwrapped cycle time of the bus.
        frames: frames read out of the sensor, this one included.
        triggers: triggers seen, including those that came while the camera was busy; -1: it does not tell.
    """

    trigger_ns: int
    frames: int
    triggers: int


class SignatureReader:
    """Reads the signatures of one camera, in the order of its frames.

    Args:
        longest_delay_ns: longest time from the beginning of the exposure to the first packet.
        order: order of the bytes, if it is known.
        pixel_bytes: bytes of a pixel, 1 or 2.
        words: of the signature: 3, or 2 without the count of triggers.

    Attributes:
        order: order of the bytes; None until a frame has shown it.
        bytes: so many bytes, and pixels of the frame, the signature has.
        line_bytes: so many bytes of the last line may hold the signature.
    """

    def __init__(
        self, longest_delay_ns: int, order: ByteOrder | None = None, *, pixel_bytes: int = 1, words: int = 3
    ) -> None:
        self.order = order
        self._places = Places.TOGETHER if pixel_bytes == 1 else None
        self._words = words
        self.bytes = words * _WORD_BYTES
        self.line_bytes = self.bytes * pixel_bytes
        self._longest_delay_ns = longest_delay_ns
        self._last: Signature | None = None
        self._refused = 0

    def read(self, data: bytes, first_packet_ns: int) -> Signature | None:
        """The signature of the next frame.

        Args:
            data: the first `line_bytes` of the last line.
            first_packet_ns: when the frame's first packet came, unwrapped cycle time, in steps of 125 us; wrong by a
                multiple of 8 s if the frame was fetched very late.

        Returns:
            None if there is no signature: the frame is torn.
        """
        orders = [self.order] if self.order is not None else list(ByteOrder)
        places = [self._places] if self._places is not None else list(Places)
        found = [
            (order, place, signature)
            for order, place in product(orders, places)
            if (signature := self._try(place.of(data, self.bytes), first_packet_ns, order))
        ]
        if not found:
            self._refused += 1
            if self._refused >= _MOST_REFUSALS:
                self._last = None
            return None
        self._refused = 0
        if len(found) == 1:
            self.order, self._places, _ = found[0]
        # Very rarely several make sense. The counters began at 0, so the smaller count is taken; the next frame
        # confirms it or not.
        signature = min((signature for *_, signature in found), key=lambda signature: signature.frames)
        self._last = signature
        return signature

    def _try(self, data: bytes, first_packet_ns: int, order: ByteOrder) -> Signature | None:
        """The signature, if it is plausible in this order of bytes."""
        word, frames, *rest = struct.unpack(f"{order.value}{self._words}I", data)
        triggers = rest[0] if rest else -1
        time = CycleTime.from_word(word)
        if not time.valid:
            return None
        trigger_ns = unwrap(time.ns, first_packet_ns)
        if (first_packet_ns + CYCLE_NS - trigger_ns) % _PACKET_WRAP_NS > CYCLE_NS + self._longest_delay_ns:
            return None
        last = self._last
        if last is not None and not (
            0 < frames - last.frames < _MOST_STEPS
            and 0 <= triggers - last.triggers < _MOST_STEPS
            and trigger_ns > last.trigger_ns
        ):
            return None
        return Signature(trigger_ns, frames, triggers)
