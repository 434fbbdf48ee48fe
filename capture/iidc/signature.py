"""The secure image signature of AVT's cameras: what the first twelve bytes of a frame's last line say.

Three words: the bus's cycle time when the exposure began, the count of frames read out, the count of triggers seen.
Whether a camera writes them with the high or the low byte first is found out by comparing with the bus's cycle timer.

libdc1394 on Linux delivers a frame that has lost a packet as if nothing had happened: all that comes after the gap has
moved up, and the end is the beginning of the next frame. The signature is then not where it should be, which is how
such frames are caught.
"""

import struct
from dataclasses import dataclass
from enum import Enum
from typing import Final

from capture.iidc.cycle_time import CYCLE_NS, CycleTime, unwrap
from rig.clocks import NS_PER_S

SIGNATURE_BYTES: Final = 12

#: The kernel stamps packets with three bits of seconds only.
_PACKET_WRAP_NS: Final = 8 * NS_PER_S
#: After so many refusals in a row it is the last frame that was misread, or the camera began anew.
_MOST_REFUSALS: Final = 3
#: More frames or triggers than this between two frames that came are none.
_MOST_STEPS: Final = 1 << 16


class ByteOrder(Enum):
    """Order of the bytes of a word."""

    BIG = ">"
    LITTLE = "<"


@dataclass(frozen=True, slots=True)
class Signature:
    """What a frame says about itself.

    Attributes:
        trigger_ns: when its exposure began, on the bus's cycle time line, unwrapped.
        frames: frames read out of the sensor, this one included.
        triggers: triggers seen, those included that came while the camera was busy.
    """

    trigger_ns: int
    frames: int
    triggers: int


class SignatureReader:
    """Reads the signatures of one camera, in the order of its frames.

    Args:
        longest_delay_ns: the first packet leaves the camera at most so long after the exposure began.
        order: of the bytes, if it is known.

    Attributes:
        order: of the bytes; None until a frame has told.
    """

    def __init__(self, longest_delay_ns: int, order: ByteOrder | None = None) -> None:
        self.order = order
        self._longest_delay_ns = longest_delay_ns
        self._last: Signature | None = None
        self._refused = 0

    def read(self, data: bytes, first_packet_ns: int) -> Signature | None:
        """The signature of the next frame.

        Args:
            data: the first `SIGNATURE_BYTES` of the last line.
            first_packet_ns: when the frame's first packet came, on the bus's cycle time line; known to 125 us, and if
                the frame was not fetched for long, wrong by a multiple of 8 s.

        Returns:
            None if there is no signature: the frame is torn.
        """
        orders = [self.order] if self.order is not None else list(ByteOrder)
        found = [(order, signature) for order in orders if (signature := self._try(data, first_packet_ns, order))]
        if not found:
            self._refused += 1
            if self._refused >= _MOST_REFUSALS:
                self._last = None
            return None
        self._refused = 0
        if len(found) == 1:
            self.order = found[0][0]
        # Both orders may make sense once in a long while: counters that began at 0 decide, the next frame confirms.
        signature = min((signature for _, signature in found), key=lambda signature: signature.frames)
        self._last = signature
        return signature

    def _try(self, data: bytes, first_packet_ns: int, order: ByteOrder) -> Signature | None:
        """The signature if it makes sense in this order of bytes."""
        word, frames, triggers = struct.unpack(f"{order.value}III", data)
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
