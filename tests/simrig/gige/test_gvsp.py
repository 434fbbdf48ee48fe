"""Stream packets as they leave the socket, against the layout in the standard."""

import ctypes
import socket
import struct
from collections.abc import Iterator

import numpy as np
import pytest

from simrig.gige.protocol.gvcp import Status
from simrig.gige.protocol.gvsp import FrameFormat, PacketTable, unavailable


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(2.0)
        sender.connect(receiver.getsockname())
        yield sender, receiver


@pytest.mark.parametrize(("packet_size", "extended", "packets"), [(576, False, 6), (576, True, 6), (9000, True, 3)])
def test_packets_of_a_frame(
    pair: tuple[socket.socket, socket.socket], packet_size: int, extended: bool, packets: int
) -> None:
    sender, receiver = pair
    image = np.arange(64 * 32, dtype=np.uint8).reshape(32, 64)
    frame = FrameFormat(64, 32, 8, 4, packet_size, extended)
    assert frame.packets == packets
    table = PacketTable(frame, image.ctypes.data)
    block_id = (1 << 40) + 3 if extended else 3
    table.prepare(block_id, 0x123456789A)
    assert table.send(sender.fileno(), 0, packets) == packets
    header = 20 if extended else 8
    pixels = b""
    for number in range(packets):
        data = receiver.recv(65536)
        assert len(data) <= packet_size - 28
        kind = 1 if number == 0 else 2 if number == packets - 1 else 3
        if extended:
            assert struct.unpack(">HHIQI", data[:20]) == (0, 0, (0x80 | kind) << 24, block_id, number)
        else:
            assert struct.unpack(">HHI", data[:8]) == (0, block_id, kind << 24 | number)
        body = data[header:]
        if kind == 1:
            leader = (0, 1, 0x12, 0x3456789A, 0x01080001, 64, 32, 8, 4, 0, 0)
            assert struct.unpack(">HHIIIIIIIHH", body) == leader
        elif kind == 2:
            assert struct.unpack(">HHI", body) == (0, 1, 32)
        else:
            pixels += body
    assert pixels == image.tobytes()


def test_the_pixels_sent_are_those_in_memory_at_that_moment(pair: tuple[socket.socket, socket.socket]) -> None:
    sender, receiver = pair
    image = np.zeros((32, 64), np.uint8)
    table = PacketTable(FrameFormat(64, 32, 0, 0, 9000, False), image.ctypes.data)
    image[...] = 9
    table.prepare(1, 0)
    table.send(sender.fileno(), 1, 1)
    assert receiver.recv(65536)[8:] == bytes([9]) * 2048


def test_damage_is_marked_and_gone_with_the_next_frame(pair: tuple[socket.socket, socket.socket]) -> None:
    sender, receiver = pair
    image = np.ones((32, 64), np.uint8)
    table = PacketTable(FrameFormat(64, 32, 0, 0, 576, False), image.ctypes.data)
    table.prepare(1, 0, damaged=[2])
    table.send(sender.fileno(), 1, 2)
    assert len(receiver.recv(65536)) == 548
    assert receiver.recv(65536) == struct.pack(">HHI", Status.DATA_OVERRUN, 1, 3 << 24 | 2)
    table.prepare(2, 0)
    table.send(sender.fileno(), 2, 1)
    assert receiver.recv(65536) == struct.pack(">HHI", 0, 2, 3 << 24 | 2) + bytes([1]) * 540


def test_an_error_of_the_socket_is_raised() -> None:
    image = np.zeros((32, 64), np.uint8)
    table = PacketTable(FrameFormat(64, 32, 0, 0, 9000, False), image.ctypes.data)
    with pytest.raises(OSError, match="sendmmsg"):
        table.send(-1, 0, 1)
    assert ctypes.get_errno() != 0


def test_unavailable_packets() -> None:
    assert unavailable(7, 5, extended=False) == struct.pack(">HHI", 0x800C, 7, 3 << 24 | 5)
    assert unavailable(7, 5, extended=True) == struct.pack(">HHIQI", 0x800C, 0, 0x83 << 24, 7, 5)
