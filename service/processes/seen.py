"""The processes of a rig as they are at one moment, and how their reports change that. Nothing is done here."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType

from rig.health import Health
from rig.phrase import NOTHING, Phrase
from rig.transport.message import Message
from rig.transport.recorder_reports import CameraChanged, CameraNews, RecorderHealth, RecorderReady, RecorderWarm
from triggering.timeline.pulse_train import RHYTHM, RHYTHM_LEAST
from triggering.timeline.steady_rate import SteadyRate, rhythm


@dataclass(frozen=True, slots=True)
class CameraPresence:
    """The recorder's last news of a camera.

    Attributes:
        news: what happened to the camera; None: no news yet.
        said: description of the camera, or why it is not there.
        counted: for a silent camera: number of health records in a row in which it delivered frames again.
    """

    news: CameraNews | None = None
    said: Phrase = NOTHING
    counted: int = 0

    @property
    def present(self) -> bool:
        """Whether the camera is connected; a silent one is, until its grabber gives it up."""
        return self.news in {CameraNews.CONNECTED, CameraNews.SILENT}

    @property
    def tried(self) -> bool:
        """Whether the camera has answered, or the grabber has failed to connect it."""
        return self.news is not None

    def delivered(self, frames_per_s: float) -> "CameraPresence":
        """After a health record: a silent camera that delivers again is there, though no report says so."""
        if self.news is not CameraNews.SILENT:
            return self
        counted = self.counted + 1 if frames_per_s else 0
        return CameraPresence(CameraNews.CONNECTED if counted > 1 else CameraNews.SILENT, self.said, counted)


class Processes(Enum):
    """Which processes of the rig run."""

    NONE = "none"
    ALL = "all"
    NO_RECORDER = "all but the recorder, which died"


@dataclass(frozen=True, slots=True)
class Seen:
    """The processes of a rig as they are at one moment.

    Attributes:
        processes: which of them run; while they are started or stopped, none.
        busy: whether they are being started or stopped.
        empty: whether nothing is left to stop.
        cameras: what was last heard of each camera; None: no processes run.
        warm: whether complete triplets have come.
        ready: whether the recorder has started.
        still: whether pulses are made on request only.
        started: when the recorder was started, on the monotonic clock, s.
        health: the recorder's last health record; None: there is none.
        rate: of the pulses, as measured last; None: not known.
        pids: process ids by row of the process table.
        restarts: how often each row was started again.
    """

    processes: Processes = Processes.NONE
    busy: bool = False
    empty: bool = True
    cameras: tuple[CameraPresence, ...] | None = None
    warm: bool = False
    ready: bool = False
    still: bool = False
    started: float = 0.0
    health: Health | None = None
    rate: SteadyRate | None = None
    pids: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    restarts: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def begun(cls, cameras: int) -> "Seen":
        """All processes of a rig with so many cameras, which have said nothing yet."""
        return cls(Processes.ALL, empty=False, cameras=(CameraPresence(),) * cameras)

    def heard(self, report: Message) -> "Seen":
        """After a report of the recorder."""
        cameras = list(self.cameras or ())
        match report:
            case CameraChanged() if report.news is not CameraNews.NOTICE:
                cameras[report.camera] = CameraPresence(report.news, report.said)
                return replace(self, cameras=tuple(cameras))
            case RecorderWarm(rate_hz=None):
                return replace(self, warm=True)
            case RecorderWarm(rate_hz=float() as rate_hz):
                return replace(self, warm=True, rate=SteadyRate(rate_hz, report.rate_error))
            case RecorderReady():
                return replace(self, ready=True)
            case RecorderHealth(health=health):
                told = zip(cameras, health.cameras, strict=True)
                delivered = tuple(camera.delivered(record.frames_per_s) for camera, record in told)
                rate = rhythm(health.pairing, RHYTHM_LEAST, RHYTHM) or self.rate
                return replace(self, health=health, rate=rate, cameras=delivered)
        return self

    def without_recorder(self) -> "Seen":
        """After the recorder's death: the presence of cameras is not known then."""
        return replace(Seen.begun(len(self.cameras or ())), processes=Processes.NO_RECORDER, still=self.still)
