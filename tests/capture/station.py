"""A grabber that runs in a thread of the test, read as the recorder reads it."""

import os
import socket
import threading
from collections.abc import Callable

from capture.grabber import Grabber
from capture.seam import Camera, Commands
from rig.frame import FrameRecord, Record
from rig.transport.ring import CameraRing
from tests.support.waiting import wait_until


class Station:
    """A grabber in a thread, and the recorder's end of its ring."""

    def __init__(
        self, open_camera: Callable[[CameraRing], Camera], ring: CameraRing, commands: Commands | None = None
    ) -> None:
        self.ring = ring
        self.records: list[Record] = []
        self.doorbell = os.eventfd(0, os.EFD_NONBLOCK)
        self._stop = threading.Event()
        self._ours, self._theirs = socket.socketpair()
        grabber = Grabber(
            lambda: open_camera(ring), ring, self.doorbell,
            period_ns=33_333_333, stopping=self._stop.is_set, stop_fd=self._theirs.fileno(),
            commands=commands,
        )  # fmt: skip
        self._thread = threading.Thread(target=grabber.run)

    def __enter__(self) -> "Station":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._ours.close()
        self._thread.join(10)
        assert not self._thread.is_alive()
        self._theirs.close()
        os.close(self.doorbell)

    def take(self, *, release: bool = True) -> None:
        """Read all records, as the recorder does."""
        while (record := self.ring.get()) is not None:
            self.records.append(record)
            if release and isinstance(record, FrameRecord):
                self.ring.release(record.slot)

    def await_records(self, kind: type[Record], count: int, *, release: bool = True) -> None:
        """Read until `count` records of a kind have come."""

        def enough() -> bool:
            self.take(release=release)
            return sum(isinstance(record, kind) for record in self.records) >= count

        wait_until(enough, f"{count} records {kind.__name__}")
