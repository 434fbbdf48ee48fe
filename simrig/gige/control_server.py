"""The camera's control socket: a thread that takes commands and sends acknowledges."""

import heapq
import os
import selectors
import socket
import threading
from contextlib import ExitStack
from itertools import count

from rig.clocks import NS_PER_S, HostNs, host_now
from simrig.gige.command_handler import CommandHandler
from simrig.gige.control_channel import Peer
from simrig.gige.device import Device
from simrig.gige.gvcp import PORT
from simrig.gige.udp import NOBODY_LISTENS, bound

_STOP_S = 5.0
_READ_BYTES = 2048
_GLOBAL_BROADCAST = "255.255.255.255"


class ControlServer:
    """Serves GVCP at an address.

    Args:
        device: the camera.
        address: IPv4 address to bind.
        broadcast: where else to listen for discovery by broadcast, e.g. the subnet's broadcast address; None: nowhere.

    Raises:
        BadInputError: the address is in use or not of this machine.
    """

    def __init__(self, device: Device, address: str, broadcast: str | None) -> None:
        self._device = device
        self._handler = CommandHandler(device)
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
        """How long nothing has to be done unless something comes; None: for ever."""
        moments = [due for due, *_ in self._delayed[:1]]
        if (silent_at := self._device.silent_at()) is not None:
            moments.append(silent_at)
        return max(0, min(moments) - host_now()) / NS_PER_S if moments else None

    def _receive(self, listener: socket.socket) -> None:
        try:
            datagram, peer = listener.recvfrom(_READ_BYTES)
        except BlockingIOError:
            return  # a datagram with a wrong checksum wakes us, but is not there
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
            return  # a peer that got no answer asks again
        except OSError as error:
            if error.errno not in NOBODY_LISTENS:
                raise
