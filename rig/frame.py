"""What a grabber process says about a camera: the records that travel beside the pixels.

The pixels stay in the slot of the camera's ring (`rig.ring`); a `Record` of fixed size names the slot and
carries ids and times. Records of one camera are in order; nothing is ever paired by that order.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from rig.clocks import DeviceNs, HostNs


class FrameStatus(StrEnum):
    """What became of one pulse in one camera. Four ways to fail, four different facts."""

    OK = "ok"
    LOST = "lost"  #: the camera took the frame, the transfer lost it
    MISSED = "missed"  #: the camera did not see the pulse
    DAMAGED = "damaged"  #: the frame came, but not whole; its pixels are not used
    ABSENT = "absent"  #: the camera was not there


class RecordKind(IntEnum):
    """Meaning of a record."""

    FRAME = 1  #: a whole frame in `slot`; ids and times valid; `value` = `StampedPixels.to_value`, 0 if there are none
    DAMAGED = 2  #: something arrived that is no whole frame; believe `host_time`, and `device_time` if `value` is 1
    LATCH = 3  #: clock reading: `device_time`, `host_time`, `value` = round trip in ns
    CONNECTED = 4  #: camera (re)configured and streaming; a new epoch begins; `text` says what it is
    DISCONNECTED = 5  #: camera gone, epoch over; `text` says why
    NOTICE = 6  #: something for the event log; `text` says what


NO_SLOT = 0xFFFFFFFF
TEXT_BYTES = 176
_LAYOUT = struct.Struct(f"<BBHIIIqqqqQ{TEXT_BYTES}s")
RECORD_BYTES = _LAYOUT.size


@dataclass(frozen=True, slots=True)
class StampedPixels:
    """Pixels of a frame that carry the camera's signature instead of the picture.

    Attributes:
        row: of the frame.
        column: the first of them.
        count: how many, to the right.
    """

    row: int
    column: int
    count: int

    def to_value(self) -> int:
        """As one number, for `Record.value`."""
        return self.row << 32 | self.column << 16 | self.count

    @classmethod
    def from_value(cls, value: int) -> "StampedPixels | None":
        """Read what `to_value` gave; None for 0."""
        return cls(value >> 32, value >> 16 & 0xFFFF, value & 0xFFFF) if value else None


@dataclass(frozen=True, slots=True)
class Record:
    """One entry of a camera's descriptor queue.

    Attributes:
        kind: what the record means.
        epoch: number of the connection, 1 for the first; ids and device times of different epochs are unrelated.
        slot: slot of the ring that holds the pixels, `NO_SLOT` if none.
        frame_id: the camera's block id (GigE Vision) or frame counter (IIDC).
        id_modulus: how many different ids there are (65535 for 16-bit block ids, which skip 0); 0: never wraps.
        device_time: device clock at the trigger, ns; of a damaged frame, if at all, only about so.
        host_time: host clock when the record was made, ns.
        trigger_count: the camera's own count of triggers seen, -1 if it has none.
        value: see `RecordKind`.
        text: for people; cut at 176 bytes.
    """

    kind: RecordKind
    epoch: int
    host_time: HostNs
    slot: int = NO_SLOT
    frame_id: int = 0
    id_modulus: int = 0
    device_time: DeviceNs = DeviceNs(0)
    trigger_count: int = -1
    value: int = 0
    text: str = ""

    def pack_into(self, buffer: memoryview, offset: int) -> None:
        """Write the record to `buffer` at `offset`; it takes `RECORD_BYTES`."""
        text = self.text.encode()[:TEXT_BYTES].decode(errors="ignore").encode()
        _LAYOUT.pack_into(
            buffer, offset, self.kind, 0, 0, self.epoch, self.slot, self.id_modulus,
            self.device_time, self.host_time, self.trigger_count, self.value, self.frame_id, text,
        )  # fmt: skip

    @classmethod
    def unpack_from(cls, buffer: memoryview, offset: int) -> "Record":
        """Read the record that `pack_into` wrote."""
        kind, _, _, epoch, slot, modulus, device, host, triggers, value, frame_id, text = _LAYOUT.unpack_from(
            buffer, offset
        )
        return cls(
            RecordKind(kind), epoch, HostNs(host), slot, frame_id, modulus, DeviceNs(device), triggers, value,
            text.rstrip(b"\0").decode() if text[0] else "",
        )  # fmt: skip
