"""Sends exposed frames one after the other, and sends single packets again on request."""

import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator

from rig.clocks import NS_PER_S, host_now
from simrig.gige.imaging.frame_store import FrameStore, Shot
from simrig.gige.protocol.gvsp import unavailable
from simrig.gige.protocol.link import Link
from simrig.world.statistics import Counters

_STOP_S = 5.0
_NAP_NS = 50_000_000  # one packet may take seconds on a slow link; the thread looks for aborts so often


class Transmitter:
    """A thread that empties the queue of exposed frames into the link.

    Args:
        link: sends the packets.
        counters: the transmitter counts frames here.
    """

    def __init__(self, link: Link, counters: Counters) -> None:
        self.link, self._counters = link, counters
        self._store: FrameStore | None = None
        self._condition = threading.Condition()
        self._queue: deque[tuple[FrameStore, Shot]] = deque()
        self._sending = self._stopping = False
        self._aborts = 0
        self._thread = threading.Thread(target=self._run, name="transmitter")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Drop unsent frames and end the thread."""
        with self._condition:
            self._stopping = True
            self._aborts += 1
            self._condition.notify_all()
        self._thread.join(_STOP_S)

    def restart(self, store: FrameStore) -> None:
        """Drop unsent frames; the next frames come from `store`."""
        with self._condition:
            self._aborts += 1
            self._condition.notify_all()
            self._condition.wait_for(lambda: not self._sending, _STOP_S)
            for old_store, shot in self._queue:
                old_store.give_back(shot.slot)
            self._queue.clear()
            store.forget()
            self._store = store

    def submit(self, store: FrameStore, shot: Shot) -> None:
        """Send a frame of `store` after the frames submitted before it, once its exposure has ended."""
        with self._condition:
            self._queue.append((store, shot))
            self._condition.notify_all()

    def resend(self, block_id: int, first: int, last: int) -> None:
        """Send packets `first` to `last` of a frame again. Only one thread may call this."""
        self._counters.resend_requests += 1
        store = self._store
        if store is None:
            return
        frame = store.format
        with store.lock:  # while it is held, the slot is not used for another frame
            shot = store.find(block_id)
            if shot is None:
                self.link.send_datagram(unavailable(block_id, first, extended=frame.extended))
                return
            end = min(last + 1, shot.sent)
            for packet in shot.damaged.intersection(range(first, end)):
                self.link.send_datagram(unavailable(block_id, packet, extended=frame.extended))
            for start, count in _runs(first, end, shot.gone | shot.damaged):
                self.link.send(shot.slot.table, start, count, frame.packet_size)
                self._counters.resent_packets += count

    def _run(self) -> None:
        while True:
            with self._condition:
                self._sending = False
                self._condition.notify_all()
                self._condition.wait_for(lambda: self._queue or self._stopping)
                if self._stopping:
                    return
                store, shot = self._queue.popleft()
                self._sending, aborts = True, self._aborts
                while aborts == self._aborts and (early_ns := shot.ready - host_now()) > 0:
                    self._condition.wait(early_ns / NS_PER_S)
            self._send(store, shot, aborts)

    def _send(self, store: FrameStore, shot: Shot, aborts: int) -> None:
        packet_size = store.format.packet_size
        table = shot.slot.table
        table.prepare(shot.block_id, shot.ticks, shot.damaged)
        store.remember(shot)
        self.link.begin_frame(shot.ready)
        for start, count in _runs(0, table.count, shot.lost):
            burst = self.link.burst(packet_size)
            for first in range(start, start + count, burst):
                if not self._await_link(aborts):
                    return
                size = min(burst, start + count - first)
                self.link.send_paced(shot.slot.table, first, size, packet_size)
                shot.sent = first + size
        shot.sent = table.count
        if len(shot.lost) < table.count:
            self._counters.frames += 1
            self._counters.last_packets.append((shot.pulse, host_now()))

    def _await_link(self, aborts: int) -> bool:
        """Wait until the link is free; False if the frame was aborted meanwhile."""
        while self._aborts == aborts:
            busy_ns = self.link.busy_ns()
            if busy_ns <= 0:
                return True
            time.sleep(min(busy_ns, _NAP_NS) / NS_PER_S)
        return False


def _runs(first: int, end: int, without: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Start and length of each run of packets from `first` to before `end`, leaving out those in `without`."""
    for gap in sorted(packet for packet in without if first <= packet < end):
        if gap > first:
            yield first, gap - first
        first = gap + 1
    if end > first:
        yield first, end - first
