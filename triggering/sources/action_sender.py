"""Sends action commands: a thread that keeps the time of the pulses, and a socket whose answers its owner reads."""

import os
import queue
import select
import socket
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rig.action import ActionCounts, ActionKeys
from rig.clocks import NS_PER_S, DeviceNs, HostNs, host_now
from rig.phrase import Phrase, phrase
from rig.settings.trigger import ActionTrigger
from triggering.sources.action_account import ActionAccount
from triggering.sources.action_command import GVCP_PORT, LAST_REQUEST_ID, decode_acknowledge, encode_action
from triggering.sources.choice import trigger_source
from triggering.sources.gate import Gate
from triggering.sources.ptp_time import PtpTime, ScheduledTrain

_READ_BYTES: Final = 1024
_STOP_S: Final = 2.0
#: The thread looks so often whether the cameras' time has become known.
_LOOK_NS: Final = NS_PER_S // 20


@dataclass(frozen=True, slots=True)
class _Sent:
    """A command, as the thread tells it to the owner before it is sent.

    Attributes:
        failures: where the command before could not be sent to, and why.
    """

    request_id: int
    time: HostNs
    failures: tuple[tuple[str, str], ...]


class _Sending:
    """The thread: does nothing but wait and send, so that no answer and no report holds up a pulse.

    Args:
        settings: of the rig file.
        origin: time of a pulse.
        targets: addresses that each command is sent to.
        gate: lets pulses through.
        sender: the socket.

    Attributes:
        ptp: the cameras' time, for scheduled commands; None: not known.
        news: the commands, each before it is sent.
    """

    def __init__(
        self, settings: ActionTrigger, origin: HostNs, targets: Sequence[str], gate: Gate, sender: socket.socket
    ) -> None:
        self.ptp: PtpTime | None = None
        self.news: queue.SimpleQueue[_Sent] = queue.SimpleQueue()
        self._settings, self._origin, self._targets = settings, origin, targets
        self._gate, self._socket, self._keys = gate, sender, ActionKeys.of(origin)
        self._last_id = 0
        self._failures: tuple[tuple[str, str], ...] = ()
        self._stop = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._thread = threading.Thread(target=self._scheduled if settings.scheduled else self._at_once, name="pulses")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        os.eventfd_write(self._stop, 1)
        self._thread.join(_STOP_S)
        os.close(self._stop)

    def _at_once(self) -> None:
        train = trigger_source(self._settings).sent(self._origin)
        if train is None:
            raise RuntimeError("scheduled commands are not sent at once")
        while True:
            now = host_now()
            if train.is_due(now) and self._gate.passes():
                self._send(None)
            if self._wait(now + train.until_next_ns(now)):
                return

    def _scheduled(self) -> None:
        settings = self._settings
        train = ScheduledTrain(settings.period_ns, settings.lead_ns, settings.lead_ns // 2)
        while True:
            now, wait_ns, ptp = host_now(), _LOOK_NS, self.ptp
            if ptp is not None:
                if (time := train.due(now, ptp)) is not None and self._gate.passes():
                    self._send(time)
                wait_ns = min(wait_ns, train.until_next_ns(now, ptp))
            if self._wait(now + wait_ns):
                return

    def _wait(self, until: int) -> bool:
        """Wait until a host time; whether the thread is to end."""
        return bool(select.select([self._stop], [], [], max(0, until - host_now()) / NS_PER_S)[0])

    def _send(self, time: DeviceNs | None) -> None:
        self._last_id = self._last_id % LAST_REQUEST_ID + 1
        command = encode_action(self._keys, self._last_id, time)
        self.news.put(_Sent(self._last_id, host_now(), self._failures))
        failures = []
        for target in self._targets:
            try:
                self._socket.sendto(command, (target, GVCP_PORT))
            except OSError as error:
                failures.append((target, error.strerror or str(error)))
        self._failures = tuple(failures)


class ActionSender:
    """Sends the commands of one rig, from `start` to `stop`.

    Args:
        settings: of the rig file.
        origin: time of a pulse, the same for all programs of the rig.
        cameras: IPv4 address and name of each camera, in the order of the rig.
        gate: lets pulses through.
    """

    def __init__(self, settings: ActionTrigger, origin: HostNs, cameras: Sequence[tuple[str, str]], gate: Gate) -> None:
        self._scheduled, self._names = settings.scheduled, [name for _, name in cameras]
        self._account = ActionAccount(cameras)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setblocking(False)
        self._socket.bind(("", 0))
        self._connected: frozenset[int] = frozenset()
        self._astray: tuple[int, ...] = ()
        self._failing: set[str] = set()
        targets = settings.broadcast or tuple(address for address, _ in cameras)
        self._sending = _Sending(settings, origin, targets, gate, self._socket)

    def fileno(self) -> int:
        """Of the socket, for select: it is readable when `read` has something to do."""
        return self._socket.fileno()

    @property
    def counts(self) -> tuple[ActionCounts, ...]:
        """What each camera has answered so far."""
        return tuple(self._account.counts)

    def start(self) -> None:
        """Start the thread."""
        self._sending.start()

    def stop(self) -> None:
        """End the thread and close the socket."""
        self._sending.stop()
        self._socket.close()

    def seen(self, connected: Sequence[bool], offsets_ns: Sequence[int | None]) -> list[Phrase]:
        """Take over what the recorder knows of the cameras.

        Args:
            connected: which of them are to answer.
            offsets_ns: device minus host time of each camera; None: not known.

        Returns:
            Which clocks show another time than those of the other cameras; said when it begins.
        """
        self._connected = frozenset(index for index, is_there in enumerate(connected) if is_there)
        if not self._scheduled:
            return []
        there = (offset if is_there else None for offset, is_there in zip(offsets_ns, connected, strict=True))
        self._sending.ptp = ptp = PtpTime.of(list(there))
        before, self._astray = self._astray, () if ptp is None else tuple(camera for camera, _ in ptp.astray)
        return [] if ptp is None or set(self._astray) <= set(before) else ptp.words(self._names)

    def read(self) -> list[Phrase]:
        """Read the answers, and stop waiting for overdue ones; to be called often.

        Returns:
            What has begun to go wrong.
        """
        told = []
        answers: list[tuple[bytes, str]] = []
        try:
            while True:
                datagram, (address, _) = self._socket.recvfrom(_READ_BYTES)
                answers.append((datagram, address))
        except BlockingIOError:
            pass  # there are no more
        told += self._take_news()  # after the answers: a command is in the queue before it is sent
        now = host_now()
        for datagram, address in answers:
            if (answer := decode_acknowledge(datagram)) is not None:
                self._account.answered(address, answer, now)
        self._account.expire(now)
        return told + self._account.told()

    def _take_news(self) -> list[Phrase]:
        """Enter the commands that the thread has sent; say where none can be sent."""
        told = []
        while not self._sending.news.empty():
            sent = self._sending.news.get()
            self._account.sent(sent.request_id, sent.time, self._connected)
            failing = {target for target, _ in sent.failures}
            text = "action commands cannot be sent to {address} ({why}): check network port and trigger.broadcast"
            told += [
                phrase("action_not_sent", text, address=target, why=why)
                for target, why in sent.failures
                if target not in self._failing
            ]
            self._failing = failing
        return told
