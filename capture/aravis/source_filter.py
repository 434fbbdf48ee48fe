"""Lets only the camera's own packets into the sockets of Aravis, by filters in the kernel, and makes room for them.

Aravis asks for the sender's address only on a packet socket, and never for its port. Whatever arrives at the port of a
stream is a packet of the camera to it, and can take the place of picture; whatever arrives at the port of the control
channel makes it wait for the right answer longer. Aravis does not hand out its sockets; they are found among those that
this process has opened meanwhile.
"""

import ctypes
import os
import socket
import struct
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from capture.aravis.receive_socket import SOCKET_BUFFER_BYTES

_SO_ATTACH_FILTER, _SO_MEMINFO = 26, 55  # <asm-generic/socket.h>
_MEMINFO = struct.Struct("9I")  # <linux/sock_diag.h>
_QUEUED, _DROPPED = 0, 8  # fields of it
_FPROG = struct.Struct("HP")  # struct sock_fprog: number of instructions, address of the first
_INSTRUCTION = struct.Struct("HBBI")  # struct sock_filter: code, jump if true, jump if false, constant

# Codes of classic BPF, <linux/bpf_common.h>: load a word, a half word or a byte from a fixed place; a half word from X
# plus a fixed place; X = length of the IP header; compare; return.
_LD_W, _LD_H, _LD_B, _LD_H_X, _LDX_IP = 0x20, 0x28, 0x30, 0x48, 0xB1
_JEQ, _JSET, _RET = 0x15, 0x45, 0x06
_ALL: Final = 0x40000  # bytes of a packet that are kept
_NET: Final = 0xFFF00000  # SKF_NET_OFF: where the IP header starts
_ETHERNET_BYTES: Final = 14
_GVCP_PORT: Final = 3956
_ETHERTYPE_IP, _UDP, _FRAGMENT = 0x0800, 17, 0x1FFF

#: A load and the value that it must give; None: the value must have none of the bits of `_FRAGMENT`.
_Check = tuple[int, int, int | None]


def open_sockets() -> dict[str, int]:
    """The sockets that this process has open: descriptor by inode, as the kernel writes it."""
    found = {}
    for path in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the descriptor of this very listing
            found[str(path.readlink())] = int(path.name)
    return {inode: descriptor for inode, descriptor in found.items() if inode.startswith("socket:")}


def filter_control(before: Collection[str], camera: str) -> None:
    """Let only answers of the camera into the control channel.

    Args:
        before: the inodes of `open_sockets()` before Aravis connected to the camera.
        camera: address of the camera.

    Raises:
        OSError: the kernel refuses the filter.
    """
    for found in opened_since(before):
        with found:
            if found.family == socket.AF_INET and found.type == socket.SOCK_DGRAM:
                _attach_udp(found, _number(camera), _GVCP_PORT)


class SourceFilter:
    """The filter of one stream: at first by the camera's address and source port.

    A camera may name a wrong source port. If packets come, but none passes, the port is no longer asked.

    Attributes:
        by_port: the port is still asked.
    """

    def __init__(self, before: Collection[str], local: tuple[str, int], camera: tuple[str, int]) -> None:
        """Find the stream's sockets, attach the filter, and enlarge the receive buffer of a plain socket.

        Aravis asks for the large buffer only once a packet has come: until then the first frames would have to fit into
        the kernel's default one.

        Args:
            before: the inodes of `open_sockets()` before the stream was made.
            local: address and port to which the camera streams.
            camera: address of the camera and port from which it streams, 0 if it names none.

        Raises:
            OSError: the kernel refuses the filter.
        """
        self._local, self._camera = local, camera
        self._received = 0
        self._doubts = 0
        self._udp: socket.socket | None = None
        self._packet: socket.socket | None = None
        self._find(before)
        self.by_port = camera[1] != 0
        try:
            self._attach()
        except BaseException:
            self.close()
            raise

    def doubt(self, received: int) -> bool:
        """Whether the port is no longer asked from now on, because packets came, but none passed.

        Call it while no frame has come. Only if a second call agrees with the first, the port is given up: between
        the two Aravis has taken what had just arrived.

        Args:
            received: number of packets that Aravis has taken since the stream was made.
        """
        if not self.by_port or self._udp is None:
            return False
        taken, self._received = received != self._received, received
        memory = _MEMINFO.unpack(self._udp.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size))
        arrived = memory[_DROPPED] or memory[_QUEUED]  # nobody reads this socket beside a packet socket
        self._doubts = self._doubts + 1 if arrived and not taken else 0
        if self._doubts < 2:
            return False
        self.by_port = False
        self._attach()
        return True

    def close(self) -> None:
        """Let go of the sockets; Aravis keeps its own descriptors of them."""
        for each in (self._udp, self._packet):
            if each is not None:
                each.close()
        self._udp = self._packet = None

    def _find(self, before: Collection[str]) -> None:
        for found in opened_since(before):
            if found.family == socket.AF_PACKET:
                self._packet = found
            elif found.family == socket.AF_INET and found.getsockname() == self._local:
                self._udp = found
            else:
                found.close()

    def _attach(self) -> None:
        host, port = self._camera
        address = _number(host)
        if self._packet is not None:
            at_ip = _ETHERNET_BYTES
            _attach(self._packet, [
                (_LD_H, at_ip - 2, _ETHERTYPE_IP), (_LD_B, at_ip + 9, _UDP), (_LD_W, at_ip + 12, address),
                (_LD_W, at_ip + 16, _number(self._local[0])), (_LD_H, at_ip + 6, None),
                *([(_LD_H_X, at_ip, port)] if self.by_port else []), (_LD_H_X, at_ip + 2, self._local[1]),
            ])  # fmt: skip
        elif self._udp is not None:
            _attach_udp(self._udp, address, port if self.by_port else None)
            self._udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER_BYTES)
        else:
            raise OSError("the socket of the stream is not found")


def opened_since(before: Collection[str]) -> Iterator[socket.socket]:
    """The sockets that this process has opened, by descriptors of our own."""
    for inode, descriptor in open_sockets().items():
        if inode not in before:
            yield socket.socket(fileno=os.dup(descriptor))


def _attach_udp(target: socket.socket, address: int, port: int | None) -> None:
    """Let only packets into a UDP socket that come from an address and, if given, a port."""
    _attach(target, [(_LD_W, _NET + 12, address), *([] if port is None else [(_LD_H, 0, port)])])


def _attach(target: socket.socket, checks: Sequence[_Check]) -> None:
    """Let only packets into a socket that pass all checks."""
    program: list[tuple[int, int, int, int]] = []
    steps = 2 * len(checks) + (_LD_H_X in {load for load, _, _ in checks})
    for load, place, value in checks:
        if load == _LD_H_X and all(code != _LDX_IP for code, *_ in program):
            program.append((_LDX_IP, 0, 0, _ETHERNET_BYTES))
        program.append((load, 0, 0, place))
        away = steps - len(program)  # instructions between the comparison and the last one, which refuses
        program.append((_JSET, away, 0, _FRAGMENT) if value is None else (_JEQ, 0, away, value))
    program += [(_RET, 0, 0, _ALL), (_RET, 0, 0, 0)]
    code = ctypes.create_string_buffer(b"".join(_INSTRUCTION.pack(*instruction) for instruction in program))
    target.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, _FPROG.pack(len(program), ctypes.addressof(code)))


def _number(address: str) -> int:
    return int.from_bytes(socket.inet_aton(address), "big")
