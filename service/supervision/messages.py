"""The messages to the supervisor, and the effects of its decisions.

A command has somebody who waits for its answer; a happening has not. What the recorder and the analysis report are
happenings too, as they come. An effect is what a decision does to the world; only `service.supervision.world` has any.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from rig.api.jump import LastJump
from rig.api.recordings import Recording, RecordingOrder, SessionChange, SessionFields, StopOrder
from rig.api.status import Status
from rig.errors import SvevError
from rig.events import Event, Level
from rig.phrase import Phrase
from rig.settings.model import RigSettings
from rig.transport.recorder_commands import RecorderCommand, StartRecording
from service.processes.rig_processes import RigReport
from service.recordings.in_progress import Outcome
from service.recordings.interruption import FoundLog
from service.supervision.situation import RigInUse

T = TypeVar("T")


class Command(msgspec.Struct, Generic[T], frozen=True):
    """A command; what raises an error leaves the situation as it was.

    Attributes:
        answer: is answered when it is done, or why it cannot be done.
    """

    answer: "Future[T]"


class Arm(Command[Status], frozen=True):
    """Begin to arm; after a fault, try again at once.

    Attributes:
        min_cameras: so many cameras are enough until the rig is disarmed; None: as many as before, or as the rig file
            says. A tap that comes when the rig is armed already lowers nothing.
    """

    min_cameras: int | None = None


class Disarm(Command[Status], frozen=True):
    """Begin to disarm."""


class Start(Command[Recording], frozen=True):
    """Record the jumper whom the order names, or the next one; answered when the log is open."""

    order: RecordingOrder


class Begin(Command[Recording], frozen=True):
    """Have the recorder open a log; answered when it is open.

    Attributes:
        start: what the recorder is told; rig file and calibration, the same for all recordings, are added to it.
        session: the session fields as people see them.
        ended: is answered when the recording is over, however that comes about.
    """

    start: StartRecording
    session: SessionFields
    ended: "Future[Outcome] | None" = None


class Stop(Command[Outcome], frozen=True):
    """Somebody wants a recording to be stopped, by its id, and how surely; answered when it is over."""

    recording: str
    order: StopOrder


class Close(Command[None], frozen=True):
    """Have the recorder close the log, without waiting for the disk if `at_once`; answered at once."""

    at_once: bool = False


class ChangeSession(Command[Recording | None], frozen=True):
    """Change session fields of the recording in progress; answered by it, or by None if this one is not in progress."""

    recording: str
    change: SessionChange


class RunTrain(Command[None], frozen=True):
    """Start or stop the train of pulses; if it is so already, nothing changes."""

    running: bool


class Burst(Command[None], frozen=True):
    """Make so many pulses while the train stands still."""

    pulses: int


class ChangeCamera(Command[None], frozen=True):
    """Use a rig with another exposure or gain of a camera, which is away for a moment while armed."""

    new: RigInUse
    camera: str


class ChangeCalibration(Command[None], frozen=True):
    """Use a rig with another calibration, which the logs have from now on."""

    new: RigInUse


class ChangeParts(Command[None], frozen=True):
    """Use a rig with other limits for the parts of a recording, from the next recording on."""

    new: RigInUse


class ChangeRate(Command[None], frozen=True):
    """Use a rig with another rate of its pulses; if it is armed, or has a fault, it is armed anew."""

    new: RigInUse


class ChangeRegion(Command[None], frozen=True):
    """Use a rig with another region of a camera; if it is armed, it is armed anew, or goes back.

    Answered when that is done, with BadInputError if a camera or a check of arming refuses the region.
    """

    new: RigInUse
    camera: str


class Note(Command[None], frozen=True):
    """Tell an event, also to the log of a recording that runs or begins soon."""

    event: Event


class Acknowledge(Command[Status], frozen=True):
    """Somebody has seen an alarm."""

    alarm: int


class MotionSeen(Command[None], frozen=True):
    """Somebody has come into sight, and no recording begins."""


class NotBegun(Command[None], frozen=True):
    """A jump came, and why no recording could begin for it."""

    why: Phrase


class JumpsKnown(Command[None], frozen=True):
    """The results of a whole log, in place of those that were measured live."""

    jumps: tuple[LastJump, ...]


class TurnBegins(msgspec.Struct, frozen=True):
    """A turn of the loop begins: one step from what is there to what is wanted."""


class TurnEnds(msgspec.Struct, frozen=True):
    """All reports of the turn have been heard."""


class RigFailed(msgspec.Struct, frozen=True):
    """Setting up failed, or the recorder died."""

    error: SvevError


class LogPrepared(msgspec.Struct, frozen=True):
    """There is room for the log of a recording, and it is known whom it is of; `more`: what the start list adds."""

    command: Start
    path: Path
    session: SessionFields
    more: Mapping[str, str]


class LogNamed(msgspec.Struct, frozen=True):
    """Another name of a log whose name another program has taken meanwhile."""

    path: Path


class LogGrown(msgspec.Struct, frozen=True):
    """The size of the log in progress, bytes."""

    size: int


class LogRead(msgspec.Struct, frozen=True):
    """The log of a dead recorder: its contents, and where the recording goes on; None: it cannot be read."""

    log: Path
    found: FoundLog | None


class End(msgspec.Struct, frozen=True):
    """The service is to end: a recording is finished first, if that takes no longer than until `by` (monotonic, s)."""

    by: float


class LoopEnds(msgspec.Struct, frozen=True):
    """The loop ends, by an error or because it was to; its processes still run."""

    failure: Exception | None = None


class ProcessesEnded(msgspec.Struct, frozen=True):
    """No process is left, and no report will come."""


Happening = (
    TurnBegins | TurnEnds | RigFailed | LogPrepared | LogNamed | LogGrown | LogRead | End | LoopEnds | ProcessesEnded
)
Message = Command[Any] | Happening | RigReport


class Say(msgspec.Struct, frozen=True):
    """Tell an event of now, also to the recorder, which publishes it and writes it into its log."""

    level: Level
    name: str
    said: Phrase


class Answer(msgspec.Struct, frozen=True):
    """Answer somebody, when the status shows what was decided."""

    to: "Future[Any]"
    value: object


class AnswerStatus(msgspec.Struct, frozen=True):
    """Answer somebody with the status, likewise."""

    to: "Future[Status]"


class Refuse(msgspec.Struct, frozen=True):
    """Answer somebody with an error, likewise."""

    to: "Future[Any]"
    error: Exception


class UseRig(msgspec.Struct, frozen=True):
    """Start processes for this rig from now on."""

    rig: RigSettings


class SetUp(msgspec.Struct, frozen=True):
    """Begin to start the simulated hill, if there is none yet, and the processes."""


class TakeDown(msgspec.Struct, frozen=True):
    """Begin to stop the processes and, unless `keep_hill`, the simulated hill."""

    keep_hill: bool


class RestartRecorder(msgspec.Struct, frozen=True):
    """Start a recorder in place of the dead one."""


class KillRecorder(msgspec.Struct, frozen=True):
    """Kill a recorder that does not answer."""


class Order(msgspec.Struct, frozen=True):
    """Command the recorder."""

    command: RecorderCommand


class RenewCamera(msgspec.Struct, frozen=True):
    """Let a camera's grabber begin anew, with its settings in the rig in use."""

    camera: str


class LetPulses(msgspec.Struct, frozen=True):
    """Have so many pulses made from now on; None: without end."""

    pulses: int | None


class PrepareLog(msgspec.Struct, frozen=True):
    """Look for room, take a name and the jumper; `LogPrepared` follows, or the command is refused."""

    command: Start


class NameLog(msgspec.Struct, frozen=True):
    """Find the next free number for the path of a log as it was ordered first; `LogNamed` follows."""

    wanted: Path


class RenameTaken(msgspec.Struct, frozen=True):
    """The start list: a recording that has just been taken has another id."""

    before: str
    after: str


class GiveBack(msgspec.Struct, frozen=True):
    """The start list: a recording was none, its jumper waits again."""

    recording: str


class MeasureLog(msgspec.Struct, frozen=True):
    """Look how large a log is; `LogGrown` follows."""

    log: Path


class LogOpened(msgspec.Struct, frozen=True):
    """The recorder has made a log; `part`: it is not the first one of its recording, but a later part."""

    log: Path
    part: bool = False


class LogsClosed(msgspec.Struct, frozen=True):
    """A recording is over; the disk did not take the end of the logs `failed`."""

    failed: tuple[Path, ...]


class ReadLog(msgspec.Struct, frozen=True):
    """Read the log of a recorder that died; `LogRead` follows. All logs of it are named after its first one's id."""

    log: Path
    first_id: str


Effect = (
    Say | Note | Answer | AnswerStatus | Refuse | UseRig | SetUp | TakeDown | RestartRecorder | KillRecorder | Order
    | RenewCamera | LetPulses | PrepareLog | NameLog | RenameTaken | GiveBack | MeasureLog | LogOpened | LogsClosed
    | ReadLog
)  # fmt: skip
#: Takes the effects of a decision, in their order.
Do = Callable[[Effect], None]
