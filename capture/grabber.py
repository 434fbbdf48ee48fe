"""The loop of a grabber process: fetches the frames of one camera into its ring.

The grabber opens the camera, reads the camera's clock against the host's, and queues one record per arrival. When the
camera fails, or falls silent so that the recorder asks for a new connection, the grabber closes the camera, opens it
again from scratch and begins a new epoch. It never gives up, and never blocks the other cameras.
"""

import os
import select
from collections.abc import Callable
from typing import Final

from capture.clock_reading import ClockReading
from capture.seam import Arrival, Camera, Commanded, Commands, OpenCamera
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import CameraError, CameraNotFoundError
from rig.frame import (
    ConnectedRecord,
    DisconnectedRecord,
    FrameRecord,
    LatchRecord,
    LimitsRecord,
    NoticeRecord,
    Record,
)
from rig.transport.ring import CameraRing

_LATCHES_AT_START: Final = 16
_COUNT_EVERY_NS: Final = NS_PER_S
_QUIET_NS: Final = NS_PER_S
_RECEIVE_S: Final = 0.05
_RETRY_S: Final = 0.5
#: Commands that were not given are told of so often at most.
_TELL_WITHHELD_NS: Final = 10 * NS_PER_S


class Grabber:
    """Drives one camera until it is told to stop.

    Args:
        open_camera: connects and configures the camera from scratch.
        ring: where frames and records go; the grabber is its only writer.
        doorbell: eventfd that wakes the recorder.
        period_ns: time between two pulses.
        stopping: tells whether the loop shall end; asked at least every 50 ms while the camera answers.
        stop_fd: becomes readable when `stopping` may have changed, so that the wait for a retry ends at once.
        commands: when the camera is told to expose; None: pulses come by cable.
    """

    def __init__(
        self,
        open_camera: OpenCamera,
        ring: CameraRing,
        doorbell: int,
        *,
        period_ns: int,
        stopping: Callable[[], bool],
        stop_fd: int,
        commands: Commands | None = None,
    ) -> None:
        self._open, self._ring, self._doorbell = open_camera, ring, doorbell
        # A camera that delivers after all has a frame within this time.
        self._last_look_s = _RECEIVE_S + 1.5 * period_ns / NS_PER_S
        self._stopping, self._stop_fd, self._commands = stopping, stop_fd, commands
        self._epoch = 0
        self._frames = self._damaged = 0
        self._told = True  # the camera had reason to send a frame while it was last waited for
        self._last_failure = ""
        self._withheld, self._tell_withheld_at = 0, HostNs(0)

    def run(self) -> None:
        """Fetch frames until told to stop."""
        self._ring.reclaim()
        while not self._stopping():
            try:
                camera = self._open()
            except (CameraError, CameraNotFoundError) as error:
                self._report_failure(str(error))
                select.select([self._stop_fd], [], [], _RETRY_S)
                continue
            try:
                self._stream(camera)
            except CameraError as error:
                self._report_failure(str(error))
            finally:
                camera.close()

    def _stream(self, camera: Camera) -> None:
        """Fetch the frames of one epoch: from a fresh connection to its end."""
        self._epoch += 1
        self._last_failure = ""
        asked = self._ring.reconnect_requests()
        self._queue(ConnectedRecord(host_now(), camera.description))
        if (limits := camera.limits) is not None:
            self._queue(LimitsRecord(host_now(), limits.model_dump_json(exclude_defaults=True)))
        for _ in range(_LATCHES_AT_START):
            self._queue(LatchRecord(camera.latch()))
        camera.start()
        if self._commands is not None:
            self._commands.begin()
        reading = ClockReading()
        next_count = last_arrival = host_now()
        while not self._stopping():
            requests = self._ring.reconnect_requests()
            wanted = requests != asked
            received = camera.bytes_received if wanted else 0
            arrival = self._receive(camera, self._last_look_s if wanted else _RECEIVE_S)
            for text in camera.notices():
                self._queue(NoticeRecord(host_now(), text))
            if arrival is not None:
                whole = isinstance(arrival, FrameRecord)
                self._frames += whole
                self._damaged += not whole
                self._queue(arrival)
            elif wanted and camera.bytes_received == received and self._told:
                # The recorder asked, then we looked once more and found nothing: the camera is silent, we are not late.
                raise CameraError("no frame while the other cameras have theirs; connecting again")
            elif wanted:
                requests = asked  # its frame is on the way, slowly, or it was told to take none: look again
            asked = requests
            # Clock and counters are read just after a frame: the next one is farthest away, and the camera is sure to
            # answer (a dead one blocks for seconds). Without pulses they are read after a second of quiet, or when the
            # last frame came out of turn.
            now = host_now()
            last_arrival = now if arrival is not None else last_arrival
            if arrival is None and now < last_arrival + _QUIET_NS and not reading.wanted:
                continue
            taken = arrival.device_time if isinstance(arrival, FrameRecord) else None
            if reading.is_due(now, taken):
                self._queue(LatchRecord(camera.latch()))
                reading.done(now)
            elif now >= next_count:
                self._count(camera)
                self._tell_withheld(now)
                next_count = HostNs(now + _COUNT_EVERY_NS)

    def _receive(self, camera: Camera, timeout_s: float) -> Arrival | None:
        """Wait for the next arrival, and meanwhile tell the camera to expose, where that is how it gets its pulses."""
        commands = self._commands
        if commands is None or not isinstance(camera, Commanded):
            return camera.receive(timeout_s)
        now = host_now()
        end = now + round(timeout_s * NS_PER_S)
        half = (now + end) // 2  # the frame of a later command may still be on its way at the end
        self._told = False
        while True:
            if commands.is_due(now):
                self._told = self._told or now <= half
                camera.fire()
                now = host_now()
            arrival = camera.receive(min(max(0, end - now), commands.until_next_ns(now)) / NS_PER_S)
            now = host_now()
            if arrival is not None or now >= end:
                return arrival

    def _tell_withheld(self, now: HostNs) -> None:
        """Say that commands would have come too late: their pulses are missed, and no camera or cable is to blame."""
        if self._commands is None:
            return
        self._withheld += self._commands.withheld()
        if self._withheld and now >= self._tell_withheld_at:
            text = (
                f"{self._withheld} pulses had no command, which would have come too late: "
                "this computer is too slow for them; lower trigger.rate_hz in the rig file, or close other programs"
            )
            self._queue(NoticeRecord(host_now(), text))
            self._withheld, self._tell_withheld_at = 0, HostNs(now + _TELL_WITHHELD_NS)

    def _report_failure(self, reason: str) -> None:
        """Report a failure once, not at every retry."""
        if reason != self._last_failure:
            self._queue(DisconnectedRecord(host_now(), reason))
        self._last_failure = reason

    def _queue(self, record: Record) -> None:
        if not self._ring.put(record, self._epoch) and isinstance(record, FrameRecord):
            self._ring.return_slot(record.slot)
        os.eventfd_write(self._doorbell, 1)

    def _count(self, camera: Camera) -> None:
        self._ring.count("frames", self._frames)
        self._ring.count("damaged", self._damaged)
        self._ring.count("reconnects", self._epoch - 1)
        for name, value in camera.counters().items():
            self._ring.count(name, value)
