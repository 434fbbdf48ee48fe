"""The host's isochronous receive DMA, packet-per-buffer mode, as the kernel's firewire-ohci programs it.

Each packet goes into the next buffer. A buffer that waits lets all packets pass until one with the sync code, the first
of a frame. A buffer that interrupts announces what was received since the last interrupt. Without a buffer, packets are
lost silently. So a lost packet shifts all packets after it until a buffer waits again: the frame then ends with the
first packets of the next frame, of which nothing else is received.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs
from simrig.firewire.host.abi import PAGE
from simrig.firewire.isochronous import CYCLE_NS, Transmission

_INTERRUPT, _WAIT = 1 << 16, 1 << 17  # in the control word of struct fw_cdev_iso_packet


@dataclass(slots=True)
class Buffers:
    """Buffers that follow each other in memory; the first may wait, the last may interrupt.

    Attributes:
        offset: offset of the next buffer in the ring.
        size: bytes of each.
        count: number of buffers left.
        waits: the next one waits for the first packet of a frame.
        interrupts: the last one interrupts.
    """

    offset: int
    size: int
    count: int
    waits: bool
    interrupts: bool


def buffers(controls: tuple[int, ...], offset: int, header_bytes: int) -> list[Buffers]:
    """The buffers that the control words of FW_CDEV_IOC_QUEUE_ISO describe, in as few entries as possible.

    Args:
        controls: control words, each for header_length / header_bytes packets.
        offset: offset of the first payload in the ring.
        header_bytes: header bytes that the context keeps of each packet.

    Raises:
        ValueError: a word has no whole number of headers.
    """
    found: list[Buffers] = []
    for control in controls:
        payload, header_length = control & 0xFFFF, control >> 24
        count, rest = divmod(header_length, header_bytes)
        if rest or not count:
            raise ValueError("no whole number of headers")
        size, waits, interrupts = payload // count, bool(control & _WAIT), bool(control & _INTERRUPT)
        last = found[-1] if found else None
        if last is not None and last.size == size and not last.interrupts and not waits:
            last.count += count
            last.interrupts = interrupts
        else:
            found.append(Buffers(offset, size, count, waits, interrupts))
        offset += payload
    return found


class ReceiveContext:
    """The receive context of one open file: a queue of buffers.

    Args:
        channel: isochronous channel it listens on.
        header_bytes: header bytes of each packet that the program wants: 4, or 8 with the cycle stamp.
        on_interrupt: called with the cycle stamp of the last packet and all headers.
        drops_headers: whether headers beyond a page are dropped (the frame is not); if not, they cause an interrupt.
    """

    def __init__(
        self, channel: int, header_bytes: int, on_interrupt: Callable[[int, bytes], None], *, drops_headers: bool
    ) -> None:
        self.channel, self.header_bytes = channel, header_bytes
        self._on_interrupt, self._drops_headers = on_interrupt, drops_headers
        self._queue: deque[Buffers] = deque()
        self._headers: list[NDArray[np.uint32]] = []
        self._started: HostNs | None = None

    @property
    def running(self) -> bool:
        """Whether packets are received."""
        return self._started is not None

    def queue(self, entries: list[Buffers]) -> None:
        """Add buffers at the end."""
        self._queue.extend(entries)

    def start(self, now: HostNs) -> None:
        """Receive from now on."""
        self._started = now

    def stop(self) -> None:
        """Receive no more and drop all buffers."""
        self._started = None
        self._queue.clear()
        self._headers.clear()

    def receive(self, frame: Transmission, ring: NDArray[np.uint8]) -> None:
        """Receive a frame that was sent on the channel."""
        if self._started is None:
            return
        missed = -(-max(0, self._started - frame.start) // CYCLE_NS)  # packets sent before the context was started
        if missed == 0 and not frame.lost and self._receive_whole(frame, ring):
            return
        arrived = [n for n in range(missed, frame.packets) if n not in frame.lost]
        for run in _runs(arrived):
            self._receive_run(frame, ring, run)

    def _receive_whole(self, frame: Transmission, ring: NDArray[np.uint8]) -> bool:
        """Receive the normal case in one copy; False if this is not the normal case."""
        head = self._queue[0] if self._queue else None
        if head is None or not (head.waits and head.interrupts) or self._headers:
            return False
        if (head.size, head.count) != (frame.packet_bytes, frame.packets):
            return False
        ring[head.offset : head.offset + len(frame.data)] = frame.data
        self._queue.popleft()
        self._keep(frame.headers())
        self._interrupt()
        return True

    def _receive_run(self, frame: Transmission, ring: NDArray[np.uint8], run: range) -> None:
        """Receive packets that arrive in consecutive cycles."""
        headers = frame.headers()
        for number in run:
            if not self._queue:
                return
            head = self._queue[0]
            if head.waits and number != 0:
                continue
            size = min(head.size, frame.packet_bytes)
            begin = number * frame.packet_bytes
            ring[head.offset : head.offset + size] = frame.data[begin : begin + size]
            self._keep(headers[number : number + 1])
            head.offset, head.count, head.waits = head.offset + head.size, head.count - 1, False
            if head.count == 0:
                self._queue.popleft()
                if head.interrupts:
                    self._interrupt()

    def _keep(self, headers: NDArray[np.uint32]) -> None:
        room = PAGE // self.header_bytes - sum(map(len, self._headers))
        self._headers.append(headers[:room])
        if len(headers) > room and not self._drops_headers:
            self._interrupt()
            self._keep(headers[room:])

    def _interrupt(self) -> None:
        headers = np.concatenate(
            self._headers, dtype=">u4"
        )  # without dtype the result has the machine's own byte order
        self._headers.clear()
        self._on_interrupt(int(headers[-1, 1]), headers[:, : self.header_bytes // 4].tobytes())


def _runs(numbers: list[int]) -> list[range]:
    """Runs of consecutive numbers."""
    if not numbers:
        return []
    breaks = [index + 1 for index, (one, two) in enumerate(pairwise(numbers)) if two != one + 1]
    return [range(numbers[a], numbers[b - 1] + 1) for a, b in pairwise([0, *breaks, len(numbers)])]
