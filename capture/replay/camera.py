"""A camera that replays its frames of a recorded log, to train operators and to test what follows the cameras.

A frame comes as long after its pulse as it did when the log was recorded, with the ids and device times of the log. The
camera returns nothing for a pulse that it missed or whose frame was lost, and a damaged frame for a damaged one. Where
it was absent it fails, and it can be opened again when it came back then.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from msgspec import UNSET

from capture.replay.timeline import Timeline
from capture.seam import Arrival
from rig.clocks import NS_PER_S, ClockLatch, HostNs, host_now, sleep_until
from rig.errors import CameraError, CameraNotFoundError
from rig.frame import DamagedRecord, FrameRecord, FrameStatus, StampedPixels
from rig.settings.camera import CameraSettings
from rig.tag import CameraTag
from rig.transport.ring import CameraRing

#: `ReplayCamera` waits for a return that is this near: the grabber would try again later than that.
_PATIENCE_NS: Final = NS_PER_S // 2


class ReplayCamera:
    """One camera of a log; see `capture.seam.Camera`.

    Args:
        settings: the camera.
        ring: where its frames go.
        timeline: its part of the log.

    Raises:
        CameraNotFoundError: the camera is absent in the log at this time.
    """

    def __init__(self, settings: CameraSettings, ring: CameraRing, timeline: Timeline) -> None:
        self._name, self._ring, self._timeline = settings.name, ring, timeline
        self._shape, self._pixel = (settings.region.height, settings.region.width), settings.format.pixels.dtype
        self._underruns = 0
        self._pulse = self._await_presence()
        self._connection = timeline.connection(self._pulse)

    @property
    def description(self) -> str:
        """Name, size and log."""
        source, (rows, columns) = self._timeline.source, self._shape
        return f"replayed camera {self._name}, {columns} x {rows}, {len(source.times)} pulses of {source.name}"

    @property
    def limits(self) -> None:
        """See `capture.seam.Camera.limits`."""
        return

    def start(self) -> None:
        """See `capture.seam.Camera.start`."""
        self._pulse = self._timeline.next_pulse(host_now())

    def receive(self, timeout_s: float) -> Arrival | None:
        """See `capture.seam.Camera.receive`."""
        deadline = HostNs(host_now() + round(timeout_s * NS_PER_S))
        while True:
            if self._leaves_by(deadline):
                raise CameraError(self._absence)
            if (ready := self._timeline.arrival(self._pulse)) > deadline:
                sleep_until(deadline)
                return None
            # The frame is read before its time and handed over on time.
            arrival = self._expose(self._pulse, ready)
            self._pulse += 1
            if arrival is not None:
                return arrival

    def latch(self) -> ClockLatch:
        """See `capture.seam.Camera.latch`."""
        return ClockLatch.computed(lambda host: self._timeline.device_time(host, self._connection))

    def counters(self) -> Mapping[str, int]:
        """Frames for which the ring had no free slot."""
        return {"underruns": self._underruns}

    def notices(self) -> Sequence[str]:
        """None: a replayed camera has nothing to report."""
        return ()

    @property
    def bytes_received(self) -> int:
        """See `capture.seam.Camera.bytes_received`."""
        return 0

    def close(self) -> None:
        """Give all slots back."""
        self._ring.reclaim()

    @property
    def _absence(self) -> str:
        return f"camera {self._name} is not there in {self._timeline.source.name} at this time: wait for its return"

    def _await_presence(self) -> int:
        """Wait until half a period before the first pulse at which the camera is there; returns the pulse's number."""
        timeline = self._timeline
        pulse = timeline.next_pulse(host_now())
        present = timeline.present_from(pulse)
        if present is None:
            raise CameraNotFoundError(
                f"camera {self._name} is absent in the whole of {timeline.source.name}: "
                "take it out of the rig file or replay another log"
            )
        if present > pulse:
            back = self._just_before(present)
            if back > host_now() + _PATIENCE_NS:
                raise CameraNotFoundError(self._absence)
            sleep_until(back)
        return present

    def _leaves_by(self, deadline: HostNs) -> bool:
        """Whether the connection ends before the next pulse and before `deadline`; if so, wait for its end."""
        timeline = self._timeline
        absent = timeline.tag(self._pulse).status is FrameStatus.ABSENT
        if not absent and timeline.connection(self._pulse) == self._connection:
            return False
        end = self._just_before(self._pulse)
        if end > deadline:
            return False
        sleep_until(end)
        return True

    def _just_before(self, pulse: int) -> HostNs:
        return HostNs(self._timeline.pulse_time(pulse) - self._timeline.source.period_ns // 2)

    def _expose(self, pulse: int, ready: HostNs) -> Arrival | None:
        tag = self._timeline.tag(pulse)
        if tag.status is FrameStatus.OK:
            return self._read(pulse, tag, ready)
        if tag.status is FrameStatus.DAMAGED:
            sleep_until(ready)
            return self._damaged(pulse)
        return None

    def _read(self, pulse: int, tag: CameraTag, ready: HostNs) -> Arrival | None:
        timeline, slot = self._timeline, self._ring.take_slot()
        if slot is None:
            self._underruns += 1
            return None
        out = self._ring.frame(slot).view(self._pixel).reshape(self._shape)
        whole = timeline.source.read_into(out, pulse % len(timeline.source.times))
        sleep_until(ready)
        if not whole:
            self._ring.return_slot(slot)
            return self._damaged(pulse)
        stamped = None
        if tag.stamped is not UNSET:
            row, column, count = tag.stamped
            stamped = StampedPixels(row, column - tag.columns[0], count)
        return FrameRecord(
            host_now(), slot, timeline.frame_id(pulse), timeline.id_modulus, timeline.frame_device_time(pulse),
            timeline.trigger_count(pulse), stamped,
        )  # fmt: skip

    def _damaged(self, pulse: int) -> Arrival:
        return DamagedRecord(host_now(), self._timeline.frame_device_time(pulse))
