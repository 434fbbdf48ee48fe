"""Stream packets that the camera did not send."""

import os
import socket
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from capture.aravis.camera import AravisCamera
from capture.aravis.receive_socket import SOCKET_BUFFER_BYTES
from capture.aravis.source_filter import SourceFilter, open_sockets
from rig.frame import FrameRecord
from simrig.gige.protocol.gvsp import FrameFormat, PacketTable
from tests.capture.aravis.camera import OneCamera, one_camera
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.repeats import repeats

_AHEAD = 12  # block ids that are forged at a time: those of frames under way, and of the next ones
_PAUSE_S = 0.002


class _Liar(threading.Thread):
    """Answers reads of registers in the camera's place, always with the same wrong number."""

    def __init__(self, address: str, target: tuple[str, int]) -> None:
        super().__init__(name="liar")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        self._socket.connect(target)
        self.sent = 0
        self._ended = threading.Event()

    def run(self) -> None:
        while not self._ended.is_set():
            for request in (*range(65300, 65536), *range(400)):
                self._socket.send(struct.pack(">HHHHI", 0, 0x0081, 4, request, 0xDEAD))  # READREG_ACK
                self.sent += 1

    def end(self) -> None:
        self._ended.set()
        self.join()
        self._socket.close()


class _Attacker(threading.Thread):
    """Sends whole white frames to the port that the camera streams to, with the block ids of the camera's next frames.

    Attributes:
        newest: block id of the camera's newest frame.
        sent: packets so far.
    """

    def __init__(self, one: OneCamera, camera: AravisCamera, address: str) -> None:
        super().__init__(name="attacker")
        region = one.rig.cameras[0].region
        frame = FrameFormat(region.width, region.height, 0, 0, one.rig.network.packet_size, extended=True)
        self._white = np.full(frame.payload_bytes, 255, np.uint8)
        self._table = PacketTable(frame, self._white.ctypes.data)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        host = camera._device.get_interface_address().get_address().to_string()
        self._socket.connect((host, camera._stream.get_port()))
        self.newest, self.sent = 0, 0
        self._ended = threading.Event()

    def run(self) -> None:
        while not self._ended.wait(_PAUSE_S):
            for block_id in range(self.newest - 1, self.newest + _AHEAD):
                self._table.prepare(block_id, 1)
                for packets in ((0, 1), (1, self._table.count - 1), (0, self._table.count)):
                    self.sent += self._table.send(self._socket.fileno(), *packets)

    def end(self) -> None:
        self._ended.set()
        self.join()
        self._socket.close()


@contextmanager
def _attacked(one: OneCamera, camera: AravisCamera, address: str) -> Iterator[_Attacker]:
    attacker = _Attacker(one, camera, address)
    attacker.newest = next(
        arrival.frame_id
        for _ in range(_WHOLE_AMONG)
        for arrival, _ in one.frames(camera, 1)
        if isinstance(arrival, FrameRecord)
    )
    attacker.start()
    try:
        yield attacker
    finally:
        attacker.end()


#: On a busy machine the first frames may all be damaged.
_WHOLE_AMONG = 200
#: A camera of 70 Hz sends too much for a plain socket; where packet sockets are not permitted it gets one all the same.
_RATES = {"off": 30.0, "auto": 70.0}


@pytest.mark.parametrize("packet_socket", _RATES)
@pytest.mark.parametrize(
    "from_the_camera", repeats([False, True]), ids=["another address", "another port of the camera"]
)
def test_what_the_camera_did_not_send_costs_nothing(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, packet_socket: str, from_the_camera: bool
) -> None:
    with (
        one_camera(tmp_path, loopback, packet_socket=packet_socket, rate_hz=_RATES[packet_socket]) as one,
        one.opened() as camera,
        _attacked(one, camera, one.address if from_the_camera else loopback.host) as attacker,
    ):
        pulses: list[int] = []
        while len(pulses) < 60 or attacker.sent < 1000:
            ((arrival, pulse),) = one.frames(camera, 1)
            if isinstance(arrival, FrameRecord):
                attacker.newest = arrival.frame_id
            pulses.append(pulse)
        assert camera.notices() == []
    _check(pulses)
    origin = "another port of the camera" if from_the_camera else "another computer"
    what = f"forged image packets from {origin} ({'plain' if packet_socket == 'off' else 'packet'} socket)"
    fault_table.tell("Network and other programs", what, lost=0, said="nothing: the kernel drops them")


@pytest.mark.parametrize("packet_socket", _RATES)
@pytest.mark.parametrize("named_port", [0, 7], ids=["none", "a wrong one"])
def test_a_camera_that_names_no_right_port_is_told_by_its_address(
    tmp_path: Path, loopback: Loopback, packet_socket: str, named_port: int
) -> None:
    rate_hz = _RATES[packet_socket]
    with (
        one_camera(tmp_path, loopback, named_port=named_port, packet_socket=packet_socket, rate_hz=rate_hz) as one,
        one.opened() as camera,
    ):
        said = camera.notices()
        assert [("streams from another port than it says" in text) for text in said] == [True] * (named_port != 0)
        with _attacked(one, camera, loopback.host) as attacker:
            pulses = [pulse for _, pulse in one.frames(camera, 30)]
    assert attacker.sent > 1000
    _check(pulses)


def _check(pulses: list[int]) -> None:
    """All frames are the camera's (their stamps are read). On a crowded machine it may lose some of them by itself."""
    whole = [pulse for pulse in pulses if pulse >= 0]
    assert whole == sorted(set(whole))
    assert len(whole) >= 0.9 * (whole[-1] - whole[0] + 1)


def test_frames_that_come_before_the_first_packet_is_taken_have_room(loopback: Loopback) -> None:
    """The kernel counts twice what is asked for, and grants no more than its limit."""
    before = open_sockets()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stream:
        stream.bind((loopback.host, 0))
        SourceFilter(before, stream.getsockname(), (loopback.host, 0)).close()
        given = stream.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    assert given == 2 * min(SOCKET_BUFFER_BYTES, int(Path("/proc/sys/net/core/rmem_max").read_text()))


def test_nobody_else_answers_for_the_camera(tmp_path: Path, loopback: Loopback) -> None:
    with one_camera(tmp_path, loopback) as one:
        before = open_sockets()
        with one.opened() as camera:
            (control,) = _receivers(before, camera._stream.get_port())
            liar = _Liar(one.address, control)
            liar.start()
            try:
                ticks_per_s = {camera._device.read_register(0x0940) for _ in range(300)}
            finally:
                liar.end()
    assert liar.sent > 1000
    assert ticks_per_s == {1_000_000_000}


def _receivers(before: Mapping[str, int], stream: int) -> list[tuple[str, int]]:
    """Addresses of the UDP sockets that were opened since, without the stream's."""
    found = []
    for inode, descriptor in open_sockets().items():
        if inode not in before:
            with socket.socket(fileno=os.dup(descriptor)) as opened:
                if opened.family == socket.AF_INET and opened.getsockname()[1] != stream:
                    found.append(opened.getsockname())
    return found
