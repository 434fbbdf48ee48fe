"""The messages from the service to the recorder process: its configuration and commands."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import msgspec

from rig.action import ActionCounts
from rig.clocks import NS_PER_US, DecimalNs, HostNs, UtcNs
from rig.events import Event
from rig.health import PulsesMade, ToldPulses
from rig.phrase import Phrase
from rig.pulse import PulseNumber
from rig.settings.model import RigSettings
from rig.transport.message import Message, Quit


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
        path: log to create; the name of the first one without `.mcap` is the id of the recording.
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
        part_s: it goes on in another log, its next part, after so many seconds; None: whatever it lasts.
        part_gb: the same before a log is larger than this, 10^9 bytes; None: however large.
        part_of: id of the recording of which the log is a later part; empty: it is the first one.
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
    part_s: float | None = None
    part_gb: float | None = None
    part_of: str = ""

    @property
    def recording(self) -> str:
        """Id of the recording."""
        return self.part_of or self.path.stem


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
    """From the process that makes the pulses, by way of the service, to the recorder: which have been fired.

    Attributes:
        first: number of the first pulse, as the source counts since its start.
        times: when the pulses fired; none: there were no more.
        uncertainty_ns: largest error of the times.
        until: all pulses up to this time have been told.
    """

    first: int
    times: tuple[HostNs, ...]
    uncertainty_ns: int
    until: HostNs

    def told(self) -> ToldPulses:
        """As a health record says it."""
        times = tuple(DecimalNs(time) for time in self.times)
        return ToldPulses(self.first, times, self.uncertainty_ns / NS_PER_US, DecimalNs(self.until))


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
