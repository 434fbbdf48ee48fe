"""The camera's control socket: a thread that receives GVCP commands, has the device carry them out, and answers."""

import heapq
import os
import selectors
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from ipaddress import IPv4Address
from itertools import count

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError
from simrig.gige.control.control_channel import Peer
from simrig.gige.control.device import Device
from simrig.gige.protocol.gvcp import (
    PORT,
    Action,
    Command,
    Discovery,
    ForceIp,
    NotGvcpError,
    PacketResend,
    ReadMemory,
    ReadRegisters,
    RefusedError,
    Request,
    Status,
    WriteMemory,
    WriteRegisters,
    acknowledge,
    memory_ack,
    parse,
    pending,
    registers_ack,
    written_ack,
)
from simrig.gige.protocol.link import NOBODY_LISTENS, bound
from simrig.gige.registers.register_map import WORD, RegisterError

_STOP_S = 5.0
_READ_BYTES = 2048
_GLOBAL_BROADCAST = "255.255.255.255"
_NS_PER_MS = 1_000_000


class ControlServer:
    """Serves GVCP at one address.

    Args:
        device: the camera.
        address: IPv4 address to bind.
        broadcast: broadcast address of the subnet, to hear discoveries by broadcast too; None: not.

    Raises:
        BadInputError: the address is in use or none of this machine's.
    """

    def __init__(self, device: Device, address: str, broadcast: str | None) -> None:
        self._device = device
        self._handler = _CommandHandler(device, self._move)
        self._resources = ExitStack()
        self._selector = self._resources.enter_context(selectors.DefaultSelector())
        self._delayed: list[tuple[HostNs, int, bytes, Peer]] = []
        self._order = count()
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._resources.callback(os.close, self._wake)
        self._stopping = False
        self._selector.register(self._wake, selectors.EVENT_READ)
        with ExitStack() as on_failure:
            on_failure.callback(self._resources.close)
            self._socket = self._listen(address, shared=False)
            for place in (_GLOBAL_BROADCAST, broadcast) if broadcast else ():
                self._listen(place, shared=True)
            on_failure.pop_all()
        self._thread = threading.Thread(target=self._run, name="control")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the sockets."""
        self._stopping = True
        os.eventfd_write(self._wake, 1)
        self._thread.join(_STOP_S)
        self._resources.close()

    def _listen(self, address: str, *, shared: bool) -> socket.socket:
        """Listen at an address; several cameras may share a broadcast address."""
        listener = self._resources.enter_context(bound(address, PORT, shared=shared))
        listener.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ)
        return listener

    def _move(self, address: str) -> None:
        """Listen at another address of the camera.

        Raises:
            BadInputError: it is in use or none of this machine's.
        """
        old, self._socket = self._socket, self._listen(address, shared=False)
        self._selector.unregister(old)
        old.close()

    def _run(self) -> None:
        while not self._stopping:
            for key, _ in self._selector.select(self._patience_s()):
                if isinstance(key.fileobj, socket.socket):
                    self._receive(key.fileobj)
            now = host_now()
            while self._delayed and self._delayed[0][0] <= now:
                _, _, data, peer = heapq.heappop(self._delayed)
                self._send(data, peer)
            silent_at = self._device.silent_at()
            if silent_at is not None and silent_at <= now:
                self._device.lose_control()

    def _patience_s(self) -> float | None:
        """Seconds until the next thing is due; None: nothing is."""
        moments = [due for due, *_ in self._delayed[:1]]
        if (silent_at := self._device.silent_at()) is not None:
            moments.append(silent_at)
        return max(0, min(moments) - host_now()) / NS_PER_S if moments else None

    def _receive(self, listener: socket.socket) -> None:
        try:
            datagram, peer = listener.recvfrom(_READ_BYTES)
        except BlockingIOError:
            return  # a datagram with a wrong checksum wakes the selector, but cannot be read
        now = host_now()
        for answer in self._handler.handle(datagram, peer, now):
            if answer.after_ns:
                entry = (HostNs(now + answer.after_ns), next(self._order), answer.data, peer)
                heapq.heappush(self._delayed, entry)
            else:
                self._send(answer.data, peer)

    def _send(self, data: bytes, peer: Peer) -> None:
        try:
            self._socket.sendto(data, peer)
        except BlockingIOError:
            return  # a peer without an answer asks again
        except OSError as error:
            if error.errno not in NOBODY_LISTENS:
                raise


@dataclass(frozen=True, slots=True)
class _Answer:
    """A datagram for the sender of a command, and the delay after which to send it."""

    data: bytes
    after_ns: int = 0


class _CommandHandler:
    """Turns commands into acknowledges. No datagram, however malformed, makes it raise."""

    def __init__(self, device: Device, move: Callable[[str], None]) -> None:
        self._device, self._move = device, move
        self._busy_ns = 0
        self._last: tuple[Peer, bytes] | None = None
        self._last_answers: list[_Answer] = []

    def handle(self, datagram: bytes, peer: Peer, now: HostNs) -> list[_Answer]:
        """Carry out the command in a datagram; returns the answers.

        A peer that missed an acknowledge sends the command again under the same number: the handler repeats the answer
        without carrying the command out again.
        """
        try:
            request = parse(datagram)
        except NotGvcpError:
            return []
        except RefusedError as refused:
            ack = acknowledge(refused.command, refused.request_id, b"", refused.status)
            return [_Answer(ack)] if refused.wants_ack else []
        self._device.control.heard(peer, now)
        if (peer, datagram) == self._last:
            return self._last_answers
        self._busy_ns = 0
        ack_data = self._do(request, peer)
        answers = self._answers(request, ack_data) if request.wants_ack and ack_data else []
        if isinstance(request.body, WriteRegisters | WriteMemory | Action | ForceIp):
            self._last, self._last_answers = (peer, datagram), answers
        return answers

    def _answers(self, request: Request, ack: bytes) -> list[_Answer]:
        if not self._busy_ns:
            return [_Answer(ack)]
        return [_Answer(pending(request.request_id, self._busy_ns // _NS_PER_MS)), _Answer(ack, self._busy_ns)]

    def _do(self, request: Request, peer: Peer) -> bytes | None:
        """Carry out a request; returns its acknowledge, None if it has none."""
        number, ack = request.request_id, None
        match request.body:
            case Discovery():
                ack = acknowledge(Command.DISCOVERY, number, self._device.discovery_data())
            case ForceIp() as order if (status := self._force_ip(order)) is not None:
                ack = acknowledge(Command.FORCEIP, number, b"", status)
            case ReadRegisters(addresses):
                ack = self._read_registers(number, addresses, peer)
            case WriteRegisters(writes):
                ack = self._write_registers(number, writes, peer)
            case ReadMemory(address, count):
                ack = self._read_memory(number, address, count, peer)
            case WriteMemory(address, data):
                ack = self._write_memory(number, address, data, peer)
            case PacketResend(block_id, first, last):
                self._device.resend(block_id, first, last)
            case Action() as action if (status := self._device.act(action)) is not None:
                ack = acknowledge(Command.ACTION, number, b"", status)
        return ack

    def _force_ip(self, order: ForceIp) -> Status | None:
        """Move to another address; None if another camera is meant."""
        if order.mac != self._device.mac:
            return None
        if self._device.control.controller is not None:
            return Status.ACCESS_DENIED
        try:
            if order.address != self._device.address:
                self._move(str(IPv4Address(order.address)))
        except BadInputError:
            return Status.INVALID_PARAMETER
        self._device.moved(order)
        return Status.SUCCESS

    def _read_memory(self, number: int, address: int, count: int, peer: Peer) -> bytes:
        try:
            return memory_ack(number, address, self._device.read(peer, address, count))
        except RegisterError as error:
            return acknowledge(Command.READMEM, number, b"", error.status)

    def _write_memory(self, number: int, address: int, data: bytes, peer: Peer) -> bytes:
        try:
            self._busy_ns = self._device.write(peer, address, data)
        except RegisterError as error:
            return written_ack(Command.WRITEMEM, number, error.done, error.status)
        return written_ack(Command.WRITEMEM, number, len(data), Status.SUCCESS)

    def _read_registers(self, number: int, addresses: tuple[int, ...], peer: Peer) -> bytes:
        values = []
        for address in addresses:
            try:
                values.append(int.from_bytes(self._device.read(peer, address, WORD), "big"))
            except RegisterError as error:
                return registers_ack(number, values, error.status)
        return registers_ack(number, values, Status.SUCCESS)

    def _write_registers(self, number: int, writes: tuple[tuple[int, int], ...], peer: Peer) -> bytes:
        for index, (address, value) in enumerate(writes):
            try:
                self._busy_ns = max(self._busy_ns, self._device.write(peer, address, value.to_bytes(WORD, "big")))
            except RegisterError as error:
                return written_ack(Command.WRITEREG, number, index, error.status)
        return written_ack(Command.WRITEREG, number, len(writes), Status.SUCCESS)
