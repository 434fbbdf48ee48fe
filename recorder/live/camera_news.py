"""Follows what becomes of each camera: whether it is connected, silent or slow; makes the news for people of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from rig.doctor_call import with_rig_in_use
from rig.frame import (
    ConnectedRecord,
    DamagedRecord,
    DisconnectedRecord,
    FrameRecord,
    LatchRecord,
    LimitsRecord,
    NoticeRecord,
    Record,
)
from rig.phrase import Phrase, phrase, plain
from rig.settings.region import RegionLimits
from rig.transport.recorder_reports import CameraChanged, CameraLimits, CameraNews
from rig.transport.ring import CameraRing
from triggering.pairing.pairer import Pairer

#: A camera whose frames come too late is told of so often at most, and when they have for so long: if the computer is
#: too slow, they come too late from the other cameras too by then.
_TELL_SLOW_NS: Final = 10 * NS_PER_S
_SURELY_SLOW_NS: Final = NS_PER_S
#: Kinds of records that only a connected camera makes.
_STREAMING: Final = (FrameRecord, DamagedRecord, LatchRecord)


@dataclass(slots=True)
class _Camera:
    """What is known of one camera.

    Attributes:
        name: in the rig file.
        connected: whether it is.
        was_there: whether it ever was.
        heard: whether a record told if it is connected.
        asked: its grabber was asked to connect it again, and it is silent since then.
        slow_since: since when its frames come too late; None: they do not.
        slow_told: when people were last told so.
    """

    name: str
    connected: bool = False
    was_there: bool = False
    heard: bool = False
    asked: bool = False
    slow_since: HostNs | None = None
    slow_told: HostNs = HostNs(-_TELL_SLOW_NS)


class CamerasWatch:
    """Follows all cameras of the rig.

    Args:
        names: of the cameras, in the rig's order.
        rings: one per camera.
        pairer: gets to know of every record that is not of a whole frame.
    """

    def __init__(self, names: Sequence[str], rings: Sequence[CameraRing], pairer: Pairer) -> None:
        self._cameras = [_Camera(name) for name in names]
        self._rings, self._pairer = rings, pairer
        self._changes: list[CameraChanged] = []
        self._limits: list[CameraLimits] = []

    @property
    def connected(self) -> list[bool]:
        """For each camera, whether it is connected."""
        return [camera.connected for camera in self._cameras]

    def changes(self) -> list[CameraChanged]:
        """What cameras have become since the last call: connected, silent, absent, gone."""
        changes, self._changes = self._changes, []
        return changes

    def limits(self) -> list[CameraLimits]:
        """Which regions cameras take that were connected since the last call."""
        limits, self._limits = self._limits, []
        return limits

    def hear(self, camera: int, record: Record) -> None:
        """Take in a record. If the first one is of a streaming camera, this recorder has replaced one that crashed."""
        if not self._cameras[camera].heard:
            self._cameras[camera].heard = isinstance(record, (*_STREAMING, ConnectedRecord, DisconnectedRecord))
            if isinstance(record, _STREAMING):
                text = "streaming since before the recorder was started"
                self._join(camera, record, phrase("camera_streaming_before", text))
        match record:
            case FrameRecord():
                pass
            case DamagedRecord():
                self._pairer.damaged(camera, record)
            case LatchRecord():
                self._pairer.latch(camera, record.latch)
            case ConnectedRecord():
                self._join(camera, record, plain(record.text))
            case DisconnectedRecord():
                self.disconnected(camera, plain(with_rig_in_use(record.text)), record.host_time)
            case LimitsRecord():
                limits = RegionLimits.model_validate_json(record.text)
                self._limits.append(CameraLimits(camera=camera, limits=limits))
            case NoticeRecord():
                self._tell(camera, CameraNews.NOTICE, plain(with_rig_in_use(record.text)))

    def disconnected(self, camera: int, reason: Phrase, time: HostNs) -> None:
        """Note that a camera is not there: its grabber says so, or the grabber died without a record of it."""
        self._pairer.disconnected(camera, time)
        self._cameras[camera].connected = False
        self._tell(camera, CameraNews.GONE if self._cameras[camera].was_there else CameraNews.ABSENT, reason)

    def look(self, now: HostNs) -> None:
        """See which cameras are silent, or too slow."""
        self._ask_silent(now)
        self._tell_slow(now)

    def _join(self, camera: int, record: Record, said: Phrase) -> None:
        self._pairer.connected(camera, record.epoch, record.host_time)
        self._cameras[camera].connected = self._cameras[camera].was_there = True
        self._tell(camera, CameraNews.CONNECTED, said)

    def _ask_silent(self, now: HostNs) -> None:
        """Once per silence, ask the grabber to connect its camera again."""
        silent = {*self._pairer.silent(), *self._pairer.overdue(now)}
        for number, camera in enumerate(self._cameras):
            if number in silent and not camera.asked:
                self._rings[number].request_reconnect()
                said = phrase("camera_behind", "three pulses behind the other cameras; looking after it")
                if self.connected.count(True) <= len(silent):
                    said = phrase("camera_mute", "the source fires, and it does not answer; looking after it")
                self._tell(number, CameraNews.SILENT, said)
            camera.asked = number in silent

    def _tell_slow(self, now: HostNs) -> None:
        """Say that a camera's frames come after their pulses are decided; people would look at its trigger cable."""
        slow = self._pairer.slow(now)
        for number, camera in enumerate(self._cameras):
            if number not in slow:
                camera.slow_since = None
                continue
            camera.slow_since = now if camera.slow_since is None else camera.slow_since
            if now < max(camera.slow_since + _SURELY_SLOW_NS, camera.slow_told + _TELL_SLOW_NS):
                continue
            camera.slow_told = now
            late_ms = self._pairer.lag_ms(number)
            others = ", ".join(self._cameras[other].name for other in slow if other != number)
            text = "its frames come too late, {late_ms:.0f} ms after the usual time: the link is too slow for them"
            said = phrase("camera_late", text, late_ms=late_ms)
            if others:
                together = (
                    "its frames come too late, {late_ms:.0f} ms after the usual time, like those of {others}: this "
                    "computer or the link they share is too slow"
                )
                said = phrase("camera_late_together", together, late_ms=late_ms, others=others)
            self._tell(number, CameraNews.NOTICE, said)

    def _tell(self, camera: int, news: CameraNews, said: Phrase) -> None:
        self._changes.append(CameraChanged(camera=camera, news=news, said=said))
