"""The messages between the processes of a rig: configurations, commands and reports, one type for each.

The first message to a child is its configuration; then the parent sends commands and the child sends reports. The
channel (`rig.transport.channel`) encodes and checks messages by these types.
"""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import ClassVar, Final

import msgspec

from rig import errors
from rig.action import ActionCounts
from rig.api.jump import LastJump
from rig.api.recordings import Counts
from rig.clocks import HostNs, UtcNs
from rig.errors import SvevError
from rig.events import Event, Level
from rig.health import Health, PulsesMade
from rig.phrase import Phrase, phrase
from rig.pulse import Pause, PulseNumber
from rig.settings.model import RigSettings


class Message(msgspec.Struct, kw_only=True, tag=True):
    """Base of all messages.

    Attributes:
        is_state: whether a message tells a state, so that only the latest of its type matters to a late reader.
    """

    is_state: ClassVar[bool] = False


class Quit(Message):
    """Command to any child: finish the work in progress, then end."""


# The grabber


class GrabberConfig(Message):
    """Configuration of a grabber process.

    Attributes:
        rig: the rig.
        camera: index of the camera to grab from.
        ring: descriptor of the camera's ring.
        doorbell: eventfd that wakes the recorder.
        epoch: host time of the simulated hill's pulse 0, of a replay's first pulse, and of a pulse that is a command.
    """

    rig: RigSettings
    camera: int
    ring: int
    doorbell: int
    epoch: HostNs


# The recorder


class RecorderOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What the recorder does beside recording.

    Attributes:
        directory: folder of the recordings; the recorder watches its disk.
        preroll_s: length of the pre-roll, s.
        preview: descriptor of the preview slot (`rig.transport.preview`); None: no preview.
    """

    directory: Path
    preroll_s: float = 0.0
    preview: int | None = None


class RecorderConfig(Message):
    """Configuration of the recorder process.

    Attributes:
        rig: the rig.
        rings: descriptor of each camera's ring.
        doorbell: eventfd that the grabbers ring.
        options: what the recorder does beside recording.
        epoch: as the grabbers have it.
    """

    rig: RigSettings
    rings: tuple[int, ...]
    doorbell: int
    options: RecorderOptions
    epoch: HostNs


class Calibration(msgspec.Struct, frozen=True, kw_only=True):
    """The interior orientations of the cameras, for a log.

    Attributes:
        json: the result file of the calibration, attached to the log as it is.
        cameras: serialized `foxglove.CameraCalibration` by camera name.
    """

    json: bytes
    cameras: Mapping[str, bytes]


class GoesOn(msgspec.Struct, frozen=True, kw_only=True):
    """A recording whose recorder died, and which goes on in another log.

    Attributes:
        recording: id of its last log.
        commanded: when the recording was started.
        pulse: number of the last pulse in that log; 0: there is none.
        time: of that pulse; None: there is none.
        period_ns: time between two pulses, by which the number of the next one is found.
    """

    recording: str
    commanded: HostNs
    pulse: PulseNumber
    time: UtcNs | None
    period_ns: float


class StartRecording(Message):
    """Command to the recorder: start a recording.

    Attributes:
        path: log to create; its name without `.mcap` is the id of the recording.
        session: fields of the session (athlete, bib, gate, wind, notes, operator, session).
        pulses: stop after so many, counted from the command; None: until told.
        seconds: stop so long after the command even if fewer pulses came; None: until told.
        nobody_stops: `seconds` are over only if nobody stops the recording; its log says so then.
        commanded: when the command was given; None: when it arrives.
        preroll_s: begin so long before the command, as far as pulses are held; None: with the oldest that is held.
        keep_s: so long after the command its pulses are held in memory too, for a stop that keeps them.
        rig_toml: the rig file as it was read, attached to the log.
        calibration: calibration of the cameras; None: not known.
        goes_on: the recording that this one continues after the death of its recorder; None: it is a new one.
    """

    path: Path
    session: Mapping[str, str]
    pulses: int | None = None
    seconds: float | None = None
    nobody_stops: bool = False
    commanded: HostNs | None = None
    preroll_s: float | None = 0.0
    keep_s: float = 0.0
    rig_toml: str = ""
    calibration: Calibration | None = None
    goes_on: GoesOn | None = None

    @property
    def recording(self) -> str:
        """Id of the recording."""
        return self.path.stem


class StopRecording(Message):
    """Command to the recorder: close the log with the pulses that have fired until now.

    Attributes:
        at_once: do not wait for the disk: give up what it has not taken.
        keep: the recording was a mishap: its last seconds belong to the next one too, if they are still held.
    """

    at_once: bool = False
    keep: bool = False


class GrabberDied(Message):
    """To the recorder: the grabber process of a camera ended; no records come until it is started again."""

    camera: int
    reason: Phrase


class TellEvent(Message):
    """To the recorder: an event of the service, for the log and for subscribers."""

    event: Event


class TellActions(Message):
    """From the process that sends action commands, by way of the service, to the recorder: what has been answered.

    Attributes:
        counts: of each camera.
    """

    is_state: ClassVar[bool] = True
    counts: tuple[ActionCounts, ...]


class TellPulses(Message):
    """From the process that makes the pulses of a line, by way of the service, to the recorder: what has been made.

    Attributes:
        made: the pulses.
    """

    is_state: ClassVar[bool] = True
    made: PulsesMade


class TellResult(Message):
    """To the recorder: a result of the analysis, for the log if that recording still runs, and for subscribers.

    Attributes:
        recording: id of the recording that it belongs to.
        topic: name of the channel, one of `rig.topics.RESULTS`.
        pulse: number of the pulse in the recording.
        time: of the pulse.
        data: the encoded message.
    """

    recording: str
    topic: str
    pulse: PulseNumber
    time: UtcNs
    data: bytes


class PulsesFired(Message):
    """From the process that drives a trigger box, by way of the service, to the recorder: what the box has fired.

    Attributes:
        first: number of the first pulse, as the box counts since its start.
        times: when the pulses fired; none: there were no more.
        uncertainty_ns: largest error of the times.
        until: all pulses up to this time have been told.
    """

    first: int
    times: tuple[HostNs, ...]
    uncertainty_ns: int
    until: HostNs


RecorderCommand = (
    StartRecording
    | StopRecording
    | GrabberDied
    | TellEvent
    | TellActions
    | TellPulses
    | PulsesFired
    | TellResult
    | Quit
)


# The analysis


class AnalysisConfig(Message):
    """Configuration of the analysis process.

    Attributes:
        rig: the rig; its `analysis` says where survey or calibration are.
        directory: where the logs are.
    """

    rig: RigSettings
    directory: Path


class JumpMeasured(Message):
    """A jump was measured.

    Attributes:
        jump: its main figures.
    """

    jump: LastJump


class AnalysisTold(Message):
    """Something that people should know of the analysis."""

    event: Event


AnalysisReport = TellResult | JumpMeasured | AnalysisTold


class CameraNews(StrEnum):
    """What happened to a camera."""

    CONNECTED = "connected"
    SILENT = "silent"  #: connected, but three pulses behind the other cameras; its grabber connects it again
    GONE = "gone"
    NOTICE = "notice"  #: no change of state, but people should know

    @property
    def level(self) -> Level:
        """Severity, as an event."""
        return _LEVELS[self]


#: What an event says of the news.
_NEWS: Final[dict[CameraNews, Callable[[Phrase], Phrase]]] = {
    CameraNews.CONNECTED: lambda said: phrase("event_camera_connected", "connected: {said}", said=said),
    CameraNews.SILENT: lambda said: phrase("event_camera_silent", "silent: {said}", said=said),
    CameraNews.GONE: lambda said: phrase("event_camera_gone", "gone: {said}", said=said),
    CameraNews.NOTICE: lambda said: phrase("event_camera_notice", "notice: {said}", said=said),
}
_LEVELS: Final = {
    CameraNews.CONNECTED: Level.INFO,
    CameraNews.SILENT: Level.WARNING,
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
    """A camera was connected, fell silent or is gone.

    Attributes:
        camera: index of the camera.
        news: what happened.
        said: description of the camera, or why it is gone.
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
    """The log failed, and the recording goes on in another one.

    Attributes:
        path: the new log.
        before: the log that failed.
    """

    path: Path
    before: LogPart


class RecordingFinished(RecordingProgress):
    """The recording has ended; `counts` are those of the pulses that are in its log.

    Attributes:
        path: the log; the last one if the recording has several.
        bytes: its size.
        unpublished: triplets that the recorder has dropped so far because subscribers were too slow.
        earlier: the logs before it, which failed.
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
    | RecordingStarted
    | RecordingProgress
    | RecordingContinued
    | RecordingFinished
    | RecorderFailed
    | RecorderEvent
    | RecorderHealth
)
