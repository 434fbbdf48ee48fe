"""A rig service in memory: the states of the real one, triplets of noise, real logs. No cameras, no processes."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric

from analysis.images.aids import exposure, focus, sharp
from recorder.catalogue.folder import Catalogue
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.api.automatic import AutomaticChange, JumpMark, Marked
from rig.api.cameras.aids import BINS, CameraAids
from rig.api.cameras.balls import CameraBalls
from rig.api.cameras.light import CameraLight, LightChange
from rig.api.jump import LastJump
from rig.api.measuring import MeasuringQueue
from rig.api.parts import PartsChange, PartsView
from rig.api.recordings import Counts, Recording, RecordingOrder, RecordingState, SessionChange, StopOrder
from rig.api.rehearsal import Rehearsal, RehearsalOrder, Rehearsals
from rig.api.statement import Level, Statement
from rig.api.status import (
    Alarm,
    ArmOrder,
    AutomaticStatus,
    CameraState,
    CameraStatus,
    DiskStatus,
    DoctorReport,
    Event,
    Finding,
    MadePulses,
    PrerollStatus,
    ProcessStatus,
    PulseStatus,
    RehearsalProgress,
    RehearsalStage,
    RigView,
    State,
    Status,
)
from rig.api.trigger import BurstOrder, TriggerChange, TriggerControl, TriggerView
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import StateForbidsError, UnknownAlarmError, UnknownCameraError, UnknownRecordingError
from rig.frame import FrameStatus
from rig.phrase import Phrase, phrase, plain
from rig.pulse import RigPulse
from rig.settings.camera import Region
from rig.settings.region import RegionLimits
from service.exports.jobs import Exports
from service.jumpers.book import JumperBook
from service.measuring.queue import Measurings
from service.offloading.releasing import Removal
from service.recordings.archive import Archive
from service.recordings.describing import as_recording
from service.recordings.measured_jumps import LogJudge, MeasuredJumps
from service.seam.cameras import CloseUp, Preview
from service.supervision.situation import Moment, Phase
from service.supervision.tap_guard import check_seen, check_stop, tap_guard
from svev.doctor.finding import Topic, passed, warning
from tests.recorder.logs import ALL_OK, PERIOD_NS, RIG, RIG_TOML, make_tag, write_pulse
from tests.support.rigs import SIM
from tests.webpanel.memory_calibrating import MemoryCalibrating

SHAPE = (120, 480)
COLUMNS = ((0, 160), (160, 320), (320, 480))
CAMERAS = ("K1", "K2", "K3")
KEPT_EVENTS = 1000
LINK = phrase("check_link", "{cameras} by {port}: MTU {mtu}", cameras="K1", port="enp2s0", mtu="1500")
#: What the line that makes the pulses has made.
MADE = MadePulses(made=1203, skipped=2, late_median_us=8.0, late_p99_us=31.0, late_max_us=44.0, realtime=True)


class MemoryService(Archive):
    """See `service.seam.rig.RigService`.

    Attributes:
        catalogue: the recordings, real logs in a real folder.
        state: may be set by tests.
        well: what `healthy` says.
        broken: raised by `status`, if set.
        last_jump: what the analysis measured last, set by tests.
        measuring: which logs are being measured, set by tests; None: as it is.
        alarms: what is wrong with pulses, clocks and cameras, set by tests.
        notice: what befell the last recording, set by tests.
        fault: what it says in a fault, set by tests.
        automatic: whether recordings begin by themselves, set by tests.
        rehearsal: how far a rehearsal is, and `rehearsed`, what the last one showed; set by tests.
        through_the_lens: what the lens makes of the picture of a camera, set by tests.
        lights: exposure, gain and region of each camera.
        pulses_made: who makes the pulses.
        split: when a recording goes on in its next part.
        bursts: pulses that were asked for.
        calibrating: what the calibration helper shows, set by tests.
        balls: where each camera should show the balls, set by tests.
        preview_calls: how often somebody asked for a picture.
        pulses_a_picture: of so many pulses one has a picture.
        settings: the rig file, whose `[analysis]` tests set.
        measurings: measures the recordings while it is entered.
    """

    def __init__(self, folder: Path) -> None:
        self.catalogue = Catalogue(folder, LogJudge())
        self.settings = SIM
        jumps = MeasuredJumps(self.catalogue)
        self.measurings = Measurings(
            folder, lambda: self.settings, self._busy, jumps.others_of_athlete, lambda _: None, self._found, self._wake,
            Removal(self.catalogue.delete, lambda: self.catalogue.trash().bytes, lambda: True),
        )  # fmt: skip
        super().__init__(self.catalogue, Exports(folder, self._busy, lambda: 1e12), self.measurings, jumps)
        self.state = State.IDLE
        self.survey: Path | None = None
        self.well = True
        self.broken: Exception | None = None
        self.last_jump: LastJump | None = None
        self.measuring: MeasuringQueue | None = None
        self.alarms: tuple[Alarm, ...] = ()
        self.notice: Statement | None = None
        self.fault: Statement | None = None
        self.automatic: AutomaticStatus | None = None
        self.rehearsal: RehearsalProgress | None = None
        self.rehearsed: Rehearsal | None = None
        self.preview_calls = 0
        self.pulses_a_picture = 1
        self.split = PartsView(part_s=None, part_gb=None, saved=True)
        self.pulses_made = TriggerView(
            source="gpio", rate_hz=30, controls=tuple(TriggerControl), running=True, saved=True
        )
        self.bursts: list[int] = []
        self.calibrating = MemoryCalibrating()
        limits = RegionLimits(
            width=320, height=240, step_x=4, step_y=2, least_width=16, least_height=2, step_width=8, step_height=2
        )
        whole = Region(width=160, height=120)
        self.lights = {
            name: CameraLight(camera=name, exposure_us=2000, gain_db=0, region=whole, limits=limits, saved=True)
            for name in CAMERAS
        }
        self.balls: Callable[[str], CameraBalls] = lambda name: CameraBalls(camera=name, width=160, height=120)
        self.through_the_lens: Callable[[NDArray[np.uint8]], NDArray[np.uint8]] = lambda image: image
        self._phase = _phase(State.IDLE, 1)
        self._armed_at = time.monotonic()
        self._lock = threading.RLock()
        self.jumpers = JumperBook(changed=self._wake)
        self._events: list[Event] = []
        self._numbers = 0
        self._listeners: set[Callable[[], None]] = set()
        self._recording: Recording | None = None
        self._last: str | None = None

    def close(self) -> None:
        """Close the catalogue's file."""
        self.catalogue.close()

    @property
    def listeners(self) -> int:
        """How many listen."""
        return len(self._listeners)

    def status(self) -> Status:
        if self.broken is not None:
            raise self.broken
        with self._lock:
            armed = self.state in {State.ARMED, State.RECORDING}
            held_s = min(5.0, time.monotonic() - self._armed_at) if armed else 0.0
            return Status(
                state=self.state,
                since=self._phase.since,
                guard=tap_guard(self._phase, time.monotonic()),
                next_jumper=self.jumpers.view().next,
                statement=(self.fault if self.state is State.FAULT else None)
                or Statement(code=f"state_{self.state.value}", text=f"The rig is {self.state.value}"),
                rig="memory",
                version="0",
                cameras=tuple(self._camera(name, block, armed) for name, block in zip(CAMERAS, COLUMNS, strict=True)),
                pulses=PulseStatus(
                    arriving=armed,
                    running=self.pulses_made.running,
                    rate_hz=30.0 if armed else None,
                    number=self._pulse() if armed else 0,
                    fired=1203 if armed else None,
                    made=MADE if armed else None,
                ),
                preroll=PrerollStatus(seconds=held_s, limit_s=5.0, memory_mb=20.0),
                disk=DiskStatus(free_gb=100.0, reserve_gb=2.0, seconds_left=3500.0, jumps_left=350, jump_s=10.0),
                recording=self._recording,
                last_recording=self._last,
                measuring=self.measuring or self.measurings.view,
                last_jump=self.last_jump,
                alarms=self.alarms,
                notice=self.notice,
                automatic=self.automatic,
                rehearsal=self.rehearsal,
                processes=(ProcessStatus(name="recorder", pid=1),),
            )

    def arm(self, order: ArmOrder | None = None) -> Status:
        if self.state is State.IDLE or (order is not None and order.min_cameras):
            self.rehearsal, self._armed_at = None, time.monotonic()
            self._become(State.ARMED)
        return self.status()

    def acknowledge(self, alarm: int) -> Status:
        if alarm not in {each.number for each in self.alarms}:
            raise UnknownAlarmError(f"there is no alarm {alarm} any more")
        self.alarms = tuple(
            each.model_copy(update={"acknowledged": each.acknowledged or each.number == alarm}) for each in self.alarms
        )
        self._wake()
        return self.status()

    def rehearsals(self) -> Rehearsals:
        return Rehearsals(running=self.rehearsal, last=self.rehearsed)

    def rehearse(self, order: RehearsalOrder) -> Rehearsals:
        del order
        if self.state is not State.IDLE:
            raise StateForbidsError(f"the rig is {self.state.value}: disarm it, then rehearse")
        self.show_rehearsal(self.rehearsal or RehearsalProgress(stage=RehearsalStage.CONNECTING))
        return self.rehearsals()

    def end_rehearsal(self) -> Rehearsals:
        self.show_rehearsal(None)
        return self.rehearsals()

    def show_rehearsal(self, progress: RehearsalProgress | None) -> None:
        """Set how far the rehearsal is."""
        self.rehearsal = progress
        self._wake()

    def disarm(self) -> Status:
        if self.state is State.RECORDING:
            raise StateForbidsError("a recording is under way: stop it first")
        if self.state is not State.IDLE:
            self._become(State.IDLE)
        return self.status()

    def start_recording(self, order: RecordingOrder) -> Recording:
        with self._lock:
            check_seen(self._phase, order.seen, time.monotonic())
            if self.state is State.RECORDING:
                raise StateForbidsError("a recording is under way: stop it first")
            if self.state is not State.ARMED:
                raise StateForbidsError(f"the rig is {self.state.value}: arm it first")
            self.pulses_made = self.pulses_made.model_copy(update={"running": True})
            now = datetime.now(UTC)
            name = f"{now:%Y%m%d-%H%M%S-%f}"
            session, _ = self.jumpers.take(name, order)
            self._recording = Recording(
                id=name, state=RecordingState.RECORDING, started=now, duration_s=0.0, bytes=0,
                counts=Counts(), session=session,
                verdict=Statement(level=Level.INFO, code="verdict_recording", text="Recording"),
            )  # fmt: skip
            started = self._recording
            self._become(State.RECORDING)
        return started if order.duration_s is None else self.stop_recording(started.id)

    def mark(self, mark: JumpMark) -> Marked:
        del mark
        if (running := self._recording) is not None:
            return Marked(started=False, recording=running)
        return Marked(started=True, recording=self.start_recording(RecordingOrder()))

    def change_automatic(self, change: AutomaticChange) -> Status:
        if self.automatic is None:
            raise StateForbidsError("nothing is watched for motion: add [automatic.motion] to the rig file")
        self.automatic = self.automatic.model_copy(update={"on": change.on})
        self._wake()
        return self.status()

    def stop_recording(self, recording_id: str, order: StopOrder | None = None) -> Recording:
        with self._lock:
            current = self._recording
            if current is None or current.id != recording_id:
                return as_recording(self.catalogue.entry(recording_id))
            check_stop(self._phase, order or StopOrder(), time.monotonic())
            self._recording, self._last = None, recording_id
            write_recording(self.catalogue.directory, recording_id, session=current.session.model_dump())
            self._become(State.ARMED)
            return as_recording(self.catalogue.entry(recording_id))

    def change_session(self, recording_id: str, change: SessionChange) -> Recording:
        fields = change.fields().model_dump(exclude_none=True)
        with self._lock:
            if self._recording is not None and self._recording.id == recording_id:
                session = self._recording.session.model_copy(update=fields)
                self._recording = self._recording.model_copy(update={"session": session})
                return self._recording
        return as_recording(self.catalogue.change_session(recording_id, change.texts()))

    def delete_recording(self, recording_id: str) -> Recording:
        if self._recording is not None and self._recording.id == recording_id:
            raise StateForbidsError("the recording is under way: stop it first")
        return as_recording(self.catalogue.delete(recording_id))

    def restore_recording(self, recording_id: str) -> Recording:
        if self._recording is not None and self._recording.id == recording_id:
            raise UnknownRecordingError(f"no recording {recording_id} in the trash: see the list of deleted recordings")
        return as_recording(self.catalogue.restore(recording_id))

    def preview(self, newer_than: RigPulse, timeout_s: float) -> Preview | None:
        self.preview_calls += 1
        deadline = time.monotonic() + timeout_s
        while self.state not in {State.ARMED, State.RECORDING} or self._pictured() == newer_than:
            if time.monotonic() > deadline:
                return None
            time.sleep(0.005)
        pulse = self._pictured()
        pixels = np.random.default_rng(pulse).integers(0, 256, SHAPE, dtype=np.uint8)
        return Preview(pulse, pixels, COLUMNS, ALL_OK)

    def camera_aids(self, camera: str, newer_than: RigPulse, timeout_s: float) -> CameraAids | None:
        frame = self.close_up(camera, newer_than, timeout_s, peaking=False)
        if frame is None:
            return None
        light = exposure(frame.pixels, BINS)
        return CameraAids(
            camera=camera, pulse=frame.pulse, status=frame.status, focus=100 * focus(frame.pixels, mosaic=False),
            mean=100 * light.mean, clipped=100 * light.clipped, black=100 * light.black, histogram=light.histogram,
        )  # fmt: skip

    def close_up(self, camera: str, newer_than: RigPulse, timeout_s: float, *, peaking: bool) -> CloseUp | None:
        if camera not in CAMERAS:
            raise UnknownCameraError(f"no camera {camera}: the rig has {', '.join(CAMERAS)}")
        found = self.preview(newer_than, timeout_s)
        if found is None:
            return None
        left, right = COLUMNS[CAMERAS.index(camera)]
        pixels = np.ascontiguousarray(self.through_the_lens(found.pixels[:, left:right]))
        return CloseUp(found.pulse, FrameStatus.OK, pixels, sharp(pixels, mosaic=False) if peaking else None)

    def camera_light(self, camera: str) -> CameraLight:
        if camera not in CAMERAS:
            raise UnknownCameraError(f"no camera {camera}: the rig has {', '.join(CAMERAS)}")
        return self.lights[camera]

    def camera_balls(self, camera: str) -> CameraBalls:
        if camera not in CAMERAS:
            raise UnknownCameraError(f"no camera {camera}: the rig has {', '.join(CAMERAS)}")
        return self.balls(camera)

    def change_light(self, camera: str, change: LightChange) -> CameraLight:
        before = self.camera_light(camera)
        if self._recording is not None:
            raise StateForbidsError("a recording is running: stop it, then change exposure or gain")
        region = before.region if change.region is None else change.region.region()
        changed = before.model_copy(update=change.values() | {"region": region})
        changed = changed.model_copy(update={"saved": before.saved and changed == before})
        self.lights[camera] = changed.model_copy(update={"saved": changed.saved or change.save})
        return self.lights[camera]

    def trigger(self) -> TriggerView:
        return self.pulses_made

    def change_trigger(self, change: TriggerChange) -> TriggerView:
        before = self.pulses_made
        if self._recording is not None:
            raise StateForbidsError("a recording is running: stop it, then change the rate")
        rate_hz = before.rate_hz if change.rate_hz is None else change.rate_hz
        running = before.running if change.running is None else change.running
        saved = change.save or (before.saved and rate_hz == before.rate_hz)
        self.pulses_made = before.model_copy(update={"rate_hz": rate_hz, "saved": saved, "running": running})
        self._wake()
        return self.pulses_made

    def parts(self) -> PartsView:
        return self.split

    def change_parts(self, change: PartsChange) -> PartsView:
        limits = change.model_dump(include=change.model_fields_set & {"part_s", "part_gb"})
        changed = self.split.model_copy(update=limits)
        saved = change.save or (self.split.saved and changed == self.split)
        self.split = changed.model_copy(update={"saved": saved})
        return self.split

    def burst(self, order: BurstOrder) -> TriggerView:
        if self.pulses_made.running:
            raise StateForbidsError("the pulses run: stop them, then ask for a number of pulses")
        self.bursts.append(order.pulses)
        return self.pulses_made

    def events(self, after: int) -> list[Event]:
        with self._lock:
            return [event for event in self._events if event.number > after]

    def listen(self, wake: Callable[[], None]) -> Callable[[], None]:
        self._listeners.add(wake)
        return lambda: self._listeners.discard(wake)

    def rig(self) -> RigView:
        return RigView(
            name="memory", toml=RIG_TOML.decode(), settings={"name": "memory", "service": {"coach_delay_s": 1.0}}
        )

    def doctor(self) -> DoctorReport:
        small = warning(Topic.NETWORK, "check_router", "{said}, but {subnet}", "do so", said=LINK, subnet="10.0.0.0/24")
        found = (passed(Topic.DISK, "", "fast enough"), small)
        findings = tuple(Finding(**asdict(finding)) for finding in found)
        return DoctorReport(worst="WARN", findings=findings)

    def metrics(self) -> list[Metric]:
        frames = CounterMetricFamily("svev_frames", "Whole frames.", labels=("camera",))
        for camera, count in (("K1", 10), ('K"2\n', 11)):
            frames.add_metric((camera,), count)
        latency = [("0.01", 3.0), ("0.1", 9.0), ("+Inf", 10.0)]
        return [
            frames,
            GaugeMetricFamily("svev_disk_free_bytes", "Free.", 1e11),
            HistogramMetricFamily("svev_latency_seconds", "Latency.", latency, 0.7),
        ]

    def healthy(self) -> bool:
        return self.well

    def say(self, message: str) -> None:
        """Add an event."""
        self.tell("info", "service", plain(message))

    def tell(self, level: Literal["info", "warning"], name: str, said: Phrase) -> None:
        with self._lock:
            self._numbers += 1
            event = Event(
                number=self._numbers, time=datetime.now(UTC), level=level, name=name,
                message=said.text, code=said.code, values=said.values,
            )  # fmt: skip
            self._events = [*self._events[-KEPT_EVENTS + 1 :], event]
        self._wake()

    def _busy(self) -> bool:
        return self.state is State.RECORDING

    def _found(self, jumps: tuple[LastJump, ...]) -> None:
        self.last_jump = jumps[-1]
        self._wake()

    def _wake(self) -> None:
        for wake in list(self._listeners):
            wake()

    def _become(self, state: State) -> None:
        self.state = state
        self._phase = _phase(state, self._phase.number + 1)
        self.say(f"now {state.value}")

    def _pulse(self) -> RigPulse:
        return RigPulse(int((time.monotonic() - self._armed_at) * 30) + 1)

    def _pictured(self) -> RigPulse:
        """The newest pulse that there is a picture of."""
        newest = self._pulse()
        return RigPulse(newest - (newest - 1) % self.pulses_a_picture)

    @staticmethod
    def _camera(name: str, columns: tuple[int, int], armed: bool) -> CameraStatus:
        state = CameraState.READY if armed else CameraState.OFF
        return CameraStatus(
            name=name, backend="sim", address=name, state=state, columns=columns,
            statement=Statement(code=f"camera_{state.value}", text=f"Camera {name} is {state.value}"),
            frames_per_s=30.0 if armed else None,
        )  # fmt: skip


def write_recording(
    folder: Path,
    recording_id: str,
    pulses: Sequence[Sequence[FrameStatus]] = (ALL_OK,) * 10,
    session: dict[str, str] | None = None,
    ago_s: int = 0,
) -> Path:
    """A closed log, whose last pulse is now, or was so long ago."""
    path = folder / f"{recording_id}.mcap"
    buffers = TripletBuffers(SHAPE, 4)
    start = time.time_ns() - len(pulses) * PERIOD_NS - ago_s * NS_PER_S
    with LogWriter(path, LogDescription(session or {}, RIG, RIG_TOML), buffers) as log:
        for pulse, statuses in enumerate(pulses, 1):
            write_pulse(log, buffers, make_tag(pulse, statuses, SHAPE, UtcNs(start + pulse * PERIOD_NS)))
    buffers.close()
    return path


def _phase(state: State, number: int) -> Phase:
    at = Moment.now()
    return Phase(state, at.utc, number, at.s)
