"""The records in which a grabber process describes frames and events of its camera to the recorder.

The pixels stay in a slot of the camera's ring (`rig.transport.ring`); a `Record` of fixed size names the slot and
carries ids and times. Records of one camera are in order, but frames are never paired by that order.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from rig.clocks import DeviceNs, HostNs


class FrameStatus(StrEnum):
    """What became of one pulse in one camera; a frame can fail to come in four different ways."""

    OK = "ok"
    LOST = "lost"  #: the camera took the frame, the transfer lost it
    MISSED = "missed"  #: the camera did not see the pulse
    DAMAGED = "damaged"  #: the frame came, but not whole; its pixels are not used
    ABSENT = "absent"  #: the camera was not connected


class RecordKind(IntEnum):
    """What a record tells of."""

    FRAME = 1  #: a whole frame in `slot`; ids and times valid; `value` = `StampedPixels.to_value`, 0 if there are none
    DAMAGED = 2  #: a frame that is not whole; only `host_time` is valid, and `device_time` if `value` is 1
    LATCH = 3  #: a clock reading: `device_time`, `host_time`, `value` = round trip in ns
    CONNECTED = 4  #: the camera is set up and streams; a new epoch begins; `text` describes the camera
    DISCONNECTED = 5  #: the camera is gone, the epoch is over; `text` says why
    NOTICE = 6  #: a message for the event log, in `text`
    LIMITS = 7  #: which regions the camera takes: `text` is JSON (`rig.settings.region.RegionLimits`)


NO_SLOT = 0xFFFFFFFF
TEXT_BYTES = 176
_LAYOUT = struct.Struct(f"<BBHIIIqqqqQ{TEXT_BYTES}s")
RECORD_BYTES = _LAYOUT.size


@dataclass(frozen=True, slots=True)
class StampedPixels:
    """Pixels of a frame that hold a signature of the camera instead of the picture.

    Attributes:
        row: row of the frame.
        column: first column.
        count: number of pixels, to the right.
    """

    row: int
    column: int
    count: int

    def to_value(self) -> int:
        """The three numbers packed into one, for `Record.value`."""
        return self.row << 32 | self.column << 16 | self.count

    @classmethod
    def from_value(cls, value: int) -> "StampedPixels | None":
        """Unpack the number that `to_value` made; None for 0."""
        return cls(value >> 32, value >> 16 & 0xFFFF, value & 0xFFFF) if value else None


@dataclass(frozen=True, slots=True)
class Record:
    """One entry of a camera's record queue.

    Attributes:
        kind: what the record tells of.
        epoch: number of the connection, 1 for the first; ids and device times of different epochs are unrelated.
        host_time: host clock when the record was made, ns.
        slot: slot of the ring that holds the pixels, `NO_SLOT` if none.
        frame_id: the camera's block id (GigE Vision) or frame counter (IIDC).
        id_modulus: number of different ids (65535 for 16-bit block ids, which skip 0); 0: the ids never wrap.
        device_time: device clock at the trigger, ns; approximate for a damaged frame, if valid at all.
        trigger_count: the camera's own count of triggers seen, -1 if it has none.
        value: see `RecordKind`.
        text: message for people; cut at 176 bytes.
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
        """Write the record into `buffer` at `offset`; it takes `RECORD_BYTES`."""
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
