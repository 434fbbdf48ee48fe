"""The trigger cable from a line of an emulated GPIO chip to one simulated camera, across processes.

The camera's process connects to the chip's socket and says which line; the chip sends each edge of it from then on. A
camera that does not read for long loses edges, as one that hangs does.
"""

import select
import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.clocks import NS_PER_S, HostNs, host_now, sleep_until
from rig.settings.trigger import GpioTrigger, TriggerSettings

#: Code of the request that connects a cable, beside the codes of ioctls (`simrig.gpio.abi.Ioctl`).
CONNECT: Final = 255
_HEAD: Final = struct.Struct("=II")
_EDGE: Final = struct.Struct("=Q?")
_PATIENCE_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class CableEnd:
    """Where a cable is plugged in.

    Attributes:
        chip: socket of the emulated chip.
        line: number or name of the line.
        active_low: low is active.
    """

    chip: Path
    line: str
    active_low: bool = False


@dataclass(frozen=True, slots=True)
class CableEdge:
    """What arrives at the camera.

    Attributes:
        time: of the edge.
        active: whether a pulse begins there, or ends.
    """

    time: HostNs
    active: bool


def cable_end(trigger: TriggerSettings) -> CableEnd | None:
    """Where the trigger cable of a rig is plugged in; None: its pulses do not come from a line of this computer."""
    if not isinstance(trigger, GpioTrigger):
        return None
    return CableEnd(Path(trigger.chip), str(trigger.line), trigger.active_low)


def encode_edge(time: HostNs, *, high: bool) -> bytes:
    """An edge as the chip sends it."""
    return _EDGE.pack(time, high)


class Cable:
    """A cable that is plugged in."""

    def __init__(self, sock: socket.socket, end: CableEnd) -> None:
        self._sock, self._end = sock, end
        self._gone = False

    @classmethod
    def plugged(cls, end: CableEnd) -> "Cable | None":
        """Plug a cable in; None: there is no emulated chip, or it has no such line."""
        sock = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            sock.settimeout(_PATIENCE_S)
            sock.connect(str(end.chip))
            line = end.line.encode()
            sock.send(_HEAD.pack(CONNECT, len(line)) + line)
            error, _ = _HEAD.unpack(sock.recv(_HEAD.size))
        except (OSError, struct.error):
            error = 1
        if error:
            sock.close()
            return None
        sock.setblocking(False)
        return cls(sock, end)

    def close(self) -> None:
        """Unplug it."""
        self._sock.close()

    def end(self) -> None:
        """From any thread: let `next_edge` wait no more."""
        with suppress(OSError):  # the chip is gone
            self._sock.shutdown(socket.SHUT_RDWR)

    def next_edge(self, until: HostNs | None) -> CableEdge | None:
        """Wait for the next edge; None: there is none up to a time, or the chip is gone.

        Args:
            until: end of the wait; None: however long it takes.
        """
        while not self._gone:
            try:
                data = self._sock.recv(_EDGE.size)
            except BlockingIOError:
                left_s = None if until is None else max(0, until - host_now()) / NS_PER_S
                if not any(select.select([self._sock], [], [], left_s)):
                    return None
                continue
            except ConnectionResetError:
                data = b""
            if len(data) == _EDGE.size:
                time, high = _EDGE.unpack(data)
                return CableEdge(HostNs(time), high != self._end.active_low)
            self._gone = True
        if until is not None:
            sleep_until(until)
        return None


class CableWatch:
    """A thread that tells of each edge of a cable, and unplugs it in the end.

    Args:
        cable: plugged in.
        tell: called for each edge, in the thread.
    """

    def __init__(self, cable: Cable, tell: Callable[[CableEdge], None]) -> None:
        self._cable, self._tell = cable, tell
        self._thread = threading.Thread(target=self._run, name="trigger cable")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._cable.end()
        self._thread.join()
        self._cable.close()

    def _run(self) -> None:
        while (edge := self._cable.next_edge(None)) is not None:
            self._tell(edge)
