"""The records in which a grabber process describes frames and events of its camera to the recorder.

The pixels stay in a slot of the camera's ring (`rig.transport.ring`); a record of fixed size names the slot and carries
ids and times. Records of one camera are in order, but frames are never paired by that order.

Each kind of record is a class of its own. A back end hands over `FrameRecord` and `DamagedRecord`; the grabber queues
them as they are, with the number of the connection (`epoch`), which is 0 until then.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum, StrEnum

import msgspec

from rig.clocks import ClockLatch, DeviceNs, HostNs


class FrameStatus(StrEnum):
    """What became of one pulse in one camera; a frame can fail to come in four different ways."""

    OK = "ok"
    LOST = "lost"  #: the camera took the frame, the transfer lost it
    MISSED = "missed"  #: the camera did not see the pulse
    DAMAGED = "damaged"  #: the frame came, but not whole; its pixels are not used
    ABSENT = "absent"  #: the camera was not connected


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
        """The three numbers packed into one."""
        return self.row << 32 | self.column << 16 | self.count

    @classmethod
    def from_value(cls, value: int) -> "StampedPixels | None":
        """Unpack the number that `to_value` made; None for 0."""
        return cls(value >> 32, value >> 16 & 0xFFFF, value & 0xFFFF) if value else None


class FrameRecord(msgspec.Struct, frozen=True):
    """A whole frame.

    Attributes:
        host_time: host clock when the back end handed the frame over, ns.
        slot: slot of the ring that holds the pixels.
        frame_id: the camera's block id (GigE Vision) or frame counter (IIDC).
        id_modulus: number of different ids (65535 for 16-bit block ids, which skip 0); 0: the ids never wrap.
        device_time: device clock at the trigger, ns.
        trigger_count: the camera's own count of triggers seen, -1 if it has none.
        stamped: pixels that carry the camera's signature instead of the picture.
        epoch: number of the connection, from 1; ids and device times of different epochs are unrelated.
    """

    host_time: HostNs
    slot: int
    frame_id: int
    id_modulus: int
    device_time: DeviceNs
    trigger_count: int = -1
    stamped: StampedPixels | None = None
    epoch: int = 0


class DamagedRecord(msgspec.Struct, frozen=True):
    """A frame that is not whole: it has no pixels, and its ids mean nothing.

    Attributes:
        host_time: host clock when the back end handed it over, ns.
        device_time: estimate of the device clock at the trigger, ns; None: not known.
        epoch: number of the connection.
    """

    host_time: HostNs
    device_time: DeviceNs | None = None
    epoch: int = 0


class LatchRecord(msgspec.Struct, frozen=True):
    """A reading of the camera's clock."""

    latch: ClockLatch
    epoch: int = 0

    @property
    def host_time(self) -> HostNs:
        """Host clock at the reading, ns."""
        return self.latch.host


class TextRecord(msgspec.Struct, frozen=True):
    """An event of the camera, with a text that is cut at 176 bytes.

    Attributes:
        host_time: host clock when the record was made, ns.
        text: see the classes below.
        epoch: number of the connection.
    """

    host_time: HostNs
    text: str = ""
    epoch: int = 0


class ConnectedRecord(TextRecord, frozen=True):
    """The camera is set up and streams; a new epoch begins. `text` describes the camera."""


class DisconnectedRecord(TextRecord, frozen=True):
    """The camera is gone, the epoch is over. `text` says why."""


class NoticeRecord(TextRecord, frozen=True):
    """A message for the event log, in `text`."""


class LimitsRecord(TextRecord, frozen=True):
    """Which regions the camera takes: `text` is JSON (`rig.settings.region.RegionLimits`)."""


_Said = ConnectedRecord | DisconnectedRecord | NoticeRecord | LimitsRecord
Record = FrameRecord | DamagedRecord | LatchRecord | _Said


class _Kind(IntEnum):
    """First byte of a packed record."""

    FRAME = 1
    DAMAGED = 2
    LATCH = 3
    CONNECTED = 4
    DISCONNECTED = 5
    NOTICE = 6
    LIMITS = 7


_TEXT_KINDS: dict[type[_Said], _Kind] = {
    ConnectedRecord: _Kind.CONNECTED,
    DisconnectedRecord: _Kind.DISCONNECTED,
    NoticeRecord: _Kind.NOTICE,
    LimitsRecord: _Kind.LIMITS,
}
_TEXT_CLASSES = {kind: made for made, kind in _TEXT_KINDS.items()}


def pack_into(record: Record, epoch: int, buffer: memoryview, offset: int) -> None:
    """Write a record into `buffer` at `offset`; it takes `RECORD_BYTES`.

    Args:
        record: the record; its own `epoch` is not used.
        epoch: number of the connection.
        buffer: memory of the queue.
        offset: bytes from its beginning.
    """
    slot = modulus = device = triggers = value = number = 0
    text = b""
    match record:
        case FrameRecord():
            kind, slot, modulus, number = _Kind.FRAME, record.slot, record.id_modulus, record.frame_id
            device, triggers = record.device_time, record.trigger_count
            value = 0 if record.stamped is None else record.stamped.to_value()
        case DamagedRecord():
            kind, device, value = _Kind.DAMAGED, record.device_time or 0, int(record.device_time is not None)
        case LatchRecord():
            kind, device, value = _Kind.LATCH, record.latch.device, record.latch.round_trip_ns
        case _:
            kind = _TEXT_KINDS[type(record)]
            text = record.text.encode()[:TEXT_BYTES].decode(errors="ignore").encode()
    _LAYOUT.pack_into(
        buffer, offset, kind, 0, 0, epoch, slot, modulus, device, record.host_time, triggers, value, number, text
    )


def unpack_from(buffer: memoryview, offset: int) -> Record:
    """Read the record that `pack_into` wrote, with its epoch.

    Raises:
        ValueError: there is no record.
    """
    kind, _, _, epoch, slot, modulus, device, host, triggers, value, number, text = _LAYOUT.unpack_from(buffer, offset)
    match kind:
        case _Kind.FRAME:
            stamped = StampedPixels.from_value(value)
            return FrameRecord(HostNs(host), slot, number, modulus, DeviceNs(device), triggers, stamped, epoch)
        case _Kind.DAMAGED:
            return DamagedRecord(HostNs(host), DeviceNs(device) if value else None, epoch)
        case _Kind.LATCH:
            return LatchRecord(ClockLatch(DeviceNs(device), HostNs(host), value), epoch)
        case _:
            made = _TEXT_CLASSES[_Kind(kind)]
            return made(HostNs(host), text.rstrip(b"\0").decode(), epoch)
