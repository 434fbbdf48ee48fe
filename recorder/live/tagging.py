"""Makes the tags of a recording: numbers its pulses, and says when they were, in UTC."""

from collections.abc import Iterator

from msgspec import UNSET

from rig.clocks import NS_PER_US, HostNs, UtcAnchor
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.settings.model import RigSettings
from rig.tag import CameraTag, TripletTag
from triggering.pairing.pairer import ClosedPulse


class Tagger:
    """Tags the pulses of one log.

    Args:
        rig: the rig.
        anchor: the recording's relation of host time to UTC.
        session: name of the session.
        recording: id of the recording.

    Attributes:
        anchor: as given.
        begun: time of the first pulse that was handed to the log; None: there is none yet.
    """

    def __init__(self, rig: RigSettings, anchor: UtcAnchor, session: str, recording: str) -> None:
        self.anchor = anchor
        self.begun: HostNs | None = None
        self._rig, self._session, self._recording = rig, session, recording
        height = rig.triplet_shape[0]
        self._cameras = [
            (camera.name, columns, UNSET if camera.region.height == height else camera.region.height)
            for camera, columns in zip(rig.cameras, rig.columns(), strict=True)
        ]
        self._next = PulseNumber(0)

    def begin(self, time: HostNs, first: PulseNumber) -> None:
        """Fix time and number of the log's first pulse."""
        self.begun, self._next = time, first

    def tag(self, pulse: ClosedPulse) -> TripletTag:
        """The tag of the next pulse, with its number in it."""
        number, self._next = self._next, PulseNumber(self._next + 1)
        time, rig = self.anchor.utc(pulse.time), self._rig
        cameras = tuple(self.camera_tags(pulse))
        return TripletTag.made(number, time, self._session, self._recording, rig.triplet_shape, cameras, rig.pixels)

    def camera_tags(self, pulse: ClosedPulse) -> Iterator[CameraTag]:
        """The cameras' parts of a pulse's tag."""
        for (name, columns, rows), outcome in zip(self._cameras, pulse.outcomes, strict=True):
            record = outcome.record
            if outcome.status is not FrameStatus.OK or record is None:
                yield CameraTag(name, columns, outcome.status, rows=rows)
                continue
            triggers = None if record.trigger_count < 0 else record.trigger_count
            offset = None if outcome.offset_ns is None else outcome.offset_ns / NS_PER_US
            host = self.anchor.utc(record.host_time)
            pixels = record.stamped
            stamped = UNSET if pixels is None else (pixels.row, columns[0] + pixels.column, pixels.count)
            yield CameraTag(
                name, columns, outcome.status, record.frame_id, triggers, record.device_time, host, offset, stamped,
                rows,
            )  # fmt: skip
