"""The messages from the recorder process to the service."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import ClassVar, Final

import msgspec

from rig import errors
from rig.api.recordings import Counts
from rig.clocks import UtcNs
from rig.errors import SvevError
from rig.events import Event, Level
from rig.health import Health
from rig.phrase import Phrase, phrase
from rig.pulse import Pause
from rig.settings.region import RegionLimits
from rig.transport.message import Message


class CameraNews(StrEnum):
    """What happened to a camera."""

    CONNECTED = "connected"
    SILENT = (
        "silent"  #: connected, but delivers nothing while others do, or the source fires; its grabber connects it again
    )
    ABSENT = "absent"  #: has not been there since the rig was armed
    GONE = "gone"  #: was there, and is not any more
    NOTICE = "notice"  #: no change of state, but people should know

    @property
    def level(self) -> Level:
        """Severity, as an event."""
        return _LEVELS[self]


#: What an event says of the news.
_NEWS: Final[dict[CameraNews, Callable[[Phrase], Phrase]]] = {
    CameraNews.CONNECTED: lambda said: phrase("event_camera_connected", "connected: {said}", said=said),
    CameraNews.SILENT: lambda said: phrase("event_camera_silent", "silent: {said}", said=said),
    CameraNews.ABSENT: lambda said: phrase("event_camera_absent", "absent: {said}", said=said),
    CameraNews.GONE: lambda said: phrase("event_camera_gone", "gone: {said}", said=said),
    CameraNews.NOTICE: lambda said: phrase("event_camera_notice", "notice: {said}", said=said),
}
_LEVELS: Final = {
    CameraNews.CONNECTED: Level.INFO,
    CameraNews.SILENT: Level.WARNING,
    CameraNews.ABSENT: Level.ERROR,
    CameraNews.GONE: Level.ERROR,
    CameraNews.NOTICE: Level.WARNING,
}


class RecorderReady(Message):
    """The recorder has started: it reads the rings and obeys commands."""


class RecorderWarm(Message):
    """Several complete triplets have come one after the other: the cameras work together.

    Attributes:
        rate_hz: rate of the pulses, measured; None: they do not come evenly.
        rate_error: share by which it can be wrong.
    """

    rate_hz: float | None = None
    rate_error: float = 0.0


class CameraChanged(Message):
    """A camera was connected, fell silent, is absent or gone.

    Attributes:
        camera: index of the camera.
        news: what happened.
        said: description of the camera, or why it is not there.
    """

    camera: int
    news: CameraNews
    said: Phrase

    def event(self, name: str) -> Event:
        """The change as an event.

        Args:
            name: of the camera.
        """
        return Event.now(self.news.level, name, _NEWS[self.news](self.said))


class CameraLimits(Message):
    """A camera that was connected has said which regions it takes.

    Attributes:
        camera: index of the camera.
        limits: of its regions.
    """

    camera: int
    limits: RegionLimits


class RecordingStarted(Message):
    """The log is open.

    Attributes:
        first_pulse: time of the recording's first pulse if it is in the pre-roll already, else None.
    """

    first_pulse: UtcNs | None


class RecordingProgress(Message):
    """Account of the recording in progress, several times a second.

    Attributes:
        counts: what became of the pulses.
        first_pulse: time of the first pulse; None: none has come yet.
        pauses: stretches of time without a pulse.
    """

    is_state: ClassVar[bool] = True
    counts: Counts
    first_pulse: UtcNs | None
    pauses: tuple[Pause, ...]


class LogPart(msgspec.Struct, frozen=True, kw_only=True):
    """One log of a recording.

    Attributes:
        path: the log.
        bytes: its size.
        counts: what became of the pulses that are in it.
        closed: the log was closed properly.
        failure: why it ended before its time, None if it did not.
    """

    path: Path
    bytes: int
    counts: Counts
    closed: bool = True
    failure: Phrase | None = None


class RecordingContinued(Message):
    """The log failed, or was as large as a part may be, and the recording goes on in another one.

    Attributes:
        path: the new log.
        before: the log before it.
    """

    path: Path
    before: LogPart


class RecordingFinished(RecordingProgress):
    """The recording has ended; `counts` are those of the pulses that are in its log.

    Attributes:
        path: the log; the last one if the recording has several.
        bytes: its size.
        unpublished: triplets that the recorder has dropped so far because subscribers were too slow.
        earlier: the logs before it, which failed, or were as large as a part may be.
        failure: why the recording ended before its time; None if it did not.
        trouble: frames that were lost because of the disk, in words; empty if none.
    """

    is_state: ClassVar[bool] = False
    path: Path
    bytes: int
    unpublished: int
    earlier: tuple[LogPart, ...] = ()
    failure: "RecorderFailed | None" = None
    trouble: str = ""


class RecorderFailed(Message):
    """A recording could not be started, or the recorder itself failed; the fields describe the error."""

    kind: str
    said: Phrase

    @classmethod
    def of(cls, error: SvevError) -> "RecorderFailed":
        """The report of an error."""
        return cls(kind=type(error).__name__, said=error.said)

    def error(self) -> SvevError:
        """The error that was reported."""
        kind = getattr(errors, self.kind, SvevError)
        return kind(self.said) if issubclass(kind, SvevError) else SvevError(self.said)


class RecorderEvent(Message):
    """Something that people should know at once, e.g. that the disk falls behind."""

    event: Event


class RecorderHealth(Message):
    """The health record, once a second."""

    is_state: ClassVar[bool] = True
    health: Health


RecorderReport = (
    RecorderReady
    | RecorderWarm
    | CameraChanged
    | CameraLimits
    | RecordingStarted
    | RecordingProgress
    | RecordingContinued
    | RecordingFinished
    | RecorderFailed
    | RecorderEvent
    | RecorderHealth
)
