"""Wire format of the GigE Vision Stream Protocol, laid out for the kernel.

A frame is leader, payload packets, trailer. `PacketTable` holds the arrays that `sendmmsg` takes (headers, iovec,
mmsghdr) for one image in memory and is built once: to send another frame from there, only block id and time change, and
the kernel reads the pixels from where they are, without a copy in Python.
"""

import ctypes
import struct
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import FORMATS
from simrig.gige.protocol.gvcp import Status

IP_UDP_BYTES = 28  #: headers below GVSP that the packet size includes
WIRE_BYTES = 38  #: Ethernet header, check sequence, preamble and gap, which it does not include

_LEADER, _TRAILER, _PAYLOAD = 1, 2, 3
_IMAGE = 1  # payload type
_LEADER_BODY = struct.Struct(">HHQIIIIIHH")
_TRAILER_BODY = struct.Struct(">HHI")
_HEADER_16 = np.dtype([("status", ">u2"), ("block_id", ">u2"), ("packet", ">u4")])
_HEADER_64 = np.dtype([("status", ">u2"), ("flags", ">u2"), ("packet", ">u4"), ("block_id", ">u8"), ("number", ">u4")])
_EXTENDED = 0x80 << 24
_MMSGHDR_BYTES = 64  # struct mmsghdr on 64-bit Linux, as 8 words
_IOVECS = 2  # header and what follows it

_libc = ctypes.CDLL(None, use_errno=True)
_libc.sendmmsg.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int)
_libc.sendmmsg.restype = ctypes.c_int


@dataclass(frozen=True, slots=True)
class FrameFormat:
    """How a frame is cut into packets.

    Attributes:
        width: columns of the image.
        height: rows of the image.
        offset_x: first column on the sensor.
        offset_y: first row on the sensor.
        packet_size: bytes on the network layer, IP and UDP headers included.
        extended: 64-bit block ids and 32-bit packet ids.
        pixel_format: how its pixels are sent, by the name in `rig.images.pixels.FORMATS`.
    """

    width: int
    height: int
    offset_x: int
    offset_y: int
    packet_size: int
    extended: bool
    pixel_format: str = "Mono8"

    @property
    def rows(self) -> slice:
        """The image's rows on the sensor."""
        return slice(self.offset_y, self.offset_y + self.height)

    @property
    def columns(self) -> slice:
        """The image's columns on the sensor."""
        return slice(self.offset_x, self.offset_x + self.width)

    @property
    def payload_bytes(self) -> int:
        """Bytes of the image."""
        return FORMATS[self.pixel_format].frame_bytes(self.width, self.height)

    @property
    def header(self) -> "np.dtype[np.void]":
        """Layout of the packet header."""
        return _HEADER_64 if self.extended else _HEADER_16

    @property
    def data_bytes(self) -> int:
        """Bytes of the image in a full packet."""
        return self.packet_size - IP_UDP_BYTES - self.header.itemsize

    @property
    def packets(self) -> int:
        """Packets of a frame, leader and trailer included."""
        return -(-self.payload_bytes // self.data_bytes) + 2


class PacketTable:
    """The packets of the image at `address`.

    Args:
        frame: format of the frame.
        address: address of its pixels, which must stay there as long as the table is used.
    """

    def __init__(self, frame: FrameFormat, address: int) -> None:
        count = frame.packets
        self.count = count
        self._format = frame
        self._headers = np.zeros(count, frame.header)
        self._fill_headers()
        self._leader = ctypes.create_string_buffer(_LEADER_BODY.size)
        self._trailer = ctypes.create_string_buffer(_TRAILER_BODY.pack(0, _IMAGE, frame.height), _TRAILER_BODY.size)
        starts = np.arange(0, frame.payload_bytes, frame.data_bytes)
        bodies = np.concatenate(([ctypes.addressof(self._leader)], address + starts, [ctypes.addressof(self._trailer)]))
        lengths = np.minimum(frame.data_bytes, frame.payload_bytes - starts)
        self._lengths = np.concatenate(([_LEADER_BODY.size], lengths, [_TRAILER_BODY.size])).astype(np.uint64)
        self._iovecs = np.zeros((count, _IOVECS, 2), np.uint64)
        self._iovecs[:, 0, 0] = _places(self._headers)
        self._iovecs[:, 0, 1] = frame.header.itemsize
        self._iovecs[:, 1, 0] = bodies
        self._iovecs[:, 1, 1] = self._lengths
        self._messages = np.zeros((count, _MMSGHDR_BYTES // 8), np.uint64)
        self._messages[:, 2] = _places(self._iovecs)
        self._messages[:, 3] = _IOVECS
        self._place = self._messages.ctypes.data
        self._damaged = False

    def _fill_headers(self) -> None:
        numbers = np.arange(self.count, dtype=np.uint32)
        kinds = np.full(self.count, _PAYLOAD << 24, np.uint32)
        kinds[0], kinds[-1] = _LEADER << 24, _TRAILER << 24
        if self._format.extended:
            self._headers["packet"] = kinds | np.uint32(_EXTENDED)
            self._headers["number"] = numbers
        else:
            self._headers["packet"] = kinds | numbers

    def prepare(self, block_id: int, ticks: int, damaged: Iterable[int] = ()) -> None:
        """Write block id and time of the next frame into the packets.

        Args:
            block_id: 16 or 64 bits.
            ticks: device time of the exposure.
            damaged: packets that the camera sends without pixels and with an error status.
        """
        frame = self._format
        self._headers["block_id"] = block_id
        _LEADER_BODY.pack_into(
            self._leader, 0, 0, _IMAGE, ticks & 0xFFFFFFFFFFFFFFFF, FORMATS[frame.pixel_format].code,
            frame.width, frame.height, frame.offset_x, frame.offset_y, 0, 0,
        )  # fmt: skip
        if self._damaged:
            self._headers["status"] = 0
            self._iovecs[:, 1, 1] = self._lengths
        which = list(damaged)
        self._damaged = bool(which)
        if which:
            self._headers["status"][which] = Status.DATA_OVERRUN
            self._iovecs[which, 1, 1] = 0

    def send(self, socket_fd: int, first: int, count: int) -> int:
        """Send `count` packets, the first of them packet number `first`, with one system call.

        Returns:
            Number of packets that the kernel took.

        Raises:
            OSError: the kernel refused the first packet.
        """
        sent: int = _libc.sendmmsg(socket_fd, self._place + first * _MMSGHDR_BYTES, count, 0)
        if sent < 0:
            number = ctypes.get_errno()
            raise OSError(number, "sendmmsg")
        return sent


def unavailable(block_id: int, packet: int, *, extended: bool) -> bytes:
    """The datagram that says that the camera no longer has packet `packet`."""
    header = np.zeros((), _HEADER_64 if extended else _HEADER_16)
    header["status"] = Status.PACKET_UNAVAILABLE
    header["block_id"] = block_id
    if extended:
        header["packet"], header["number"] = _EXTENDED | _PAYLOAD << 24, packet
    else:
        header["packet"] = _PAYLOAD << 24 | packet
    return header.tobytes()


def _places(rows: NDArray[np.generic]) -> NDArray[np.uint64]:
    """Address of every row of a contiguous array."""
    return np.uint64(rows.ctypes.data) + np.arange(len(rows), dtype=np.uint64) * np.uint64(rows.strides[0])
