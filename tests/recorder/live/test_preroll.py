"""Recordings that begin in the past: every pulse once, in order, numbered from 1, whatever happens in between."""

import itertools
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recorder.checking.verify import verify
from recorder.live import parts as parts_module
from recorder.live import pulse_writer as pulse_writer_module
from recorder.live import recording as recording_module
from recorder.live import recordings as recordings_module
from recorder.live.assembler import Assembler
from recorder.live.health import LatencyHistogram
from recorder.live.preroll import Preroll, preroll_triplets
from recorder.live.recordings import Recordings
from recorder.log.extent import FORGOTTEN
from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.publisher import Publisher
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.clocks import NS_PER_S, HostNs, UtcNs
from rig.errors import FileVanishedError, StorageError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.phrase import plain
from rig.topics import RECORDING_METADATA
from rig.transport.recorder_commands import StartRecording
from rig.transport.recorder_reports import RecorderReport, RecordingFinished, RecordingStarted
from tests.recorder.live.ring_cameras import PERIOD, SIZES, START, RingCameras, camera_rings, grey, ring_rig
from tests.recorder.publishing.test_publisher import subscriber
from tests.support.waiting import wait_until

RIG = ring_rig(reserve_gb=0)
MS = 1_000_000


class Clock:
    """The host's clock, which the test moves; every reading takes a little time."""

    def __init__(self) -> None:
        self.time = START

    def now(self) -> HostNs:
        """The time, a tenth of a millisecond after the last reading."""
        self.time += MS // 10
        return HostNs(self.time)

    def advance_to(self, time: int) -> None:
        """Move the clock to `time`, never back."""
        self.time = max(self.time, time)


@dataclass
class Recorder:
    """A recorder without its process: only the clock and the cameras' ends of the rings are not real."""

    cameras: RingCameras
    assembler: Assembler
    buffers: TripletBuffers
    preroll: Preroll
    recordings: Recordings
    clock: Clock
    path: Path
    latency: LatencyHistogram
    reports: list[RecorderReport] = field(default_factory=list)
    logs: Iterator[int] = field(default_factory=itertools.count)

    def step(self) -> None:
        """One turn of the recorder's loop."""
        now = self.clock.now()
        for triplet in self.assembler.pump(now):
            self.recordings.take(triplet)
        self.recordings.work(now)

    def expose(self, pulse: int, *cameras: int) -> None:
        """Fire a pulse: the frames of `cameras` come, those of the other cameras are lost."""
        self.clock.advance_to(self.cameras.time(pulse) + 6 * MS)
        self.cameras.expose(pulse, *cameras)
        self.cameras.expose(pulse, *(set(range(3)) - set(cameras)), lose=True)

    def start(
        self,
        preroll_s: float | None,
        *,
        pulses: int | None = None,
        seconds: float | None = None,
        keep_s: float = 0.0,
        nobody_stops: bool = False,
    ) -> Path:
        """Start a recording into a log of its own."""
        path = self.path / f"{next(self.logs)}.mcap"
        self.recordings.start(
            StartRecording(
                path=path,
                session={"session": "s"},
                pulses=pulses,
                seconds=seconds,
                preroll_s=preroll_s,
                keep_s=keep_s,
                nobody_stops=nobody_stops,
            )
        )
        before, now = len(self.reports), HostNs(self.clock.time)  # no time passes while the log is opened

        def is_open() -> bool:
            self.recordings.work(now)
            return len(self.reports) > before

        wait_until(is_open, "the log is open", timeout_s=30, poll_s=0.001)
        return path

    def has_room(self) -> bool:
        """Whether more than a few triplet buffers are free, after one more turn if need be."""
        if self.buffers.free_count <= 3:
            self.step()
        return self.buffers.free_count > 3

    def finish(self) -> RecordingFinished:
        """Take steps until the recording is closed; returns its report."""

        def closed() -> bool:
            if self.recordings.saving:
                self.recordings.work(HostNs(self.clock.time))  # no time passes while the disk works
            else:
                self.clock.advance_to(self.clock.time + 5 * MS)
                self.step()
            return not self.recordings.running

        wait_until(closed, "the recording is closed", timeout_s=30, poll_s=0.001)
        report = self.reports[-1]
        assert isinstance(report, RecordingFinished), report
        return report


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    publisher = Publisher("tcp://127.0.0.1:*")
    yield publisher
    publisher.close()


@contextmanager
def _recorder(path: Path, publisher: Publisher, seconds: float, limit: int) -> Iterator[Recorder]:
    clock = Clock()
    with camera_rings(RIG, slots=64) as rings, pytest.MonkeyPatch.context() as patch:
        for module in (parts_module, pulse_writer_module, recording_module, recordings_module):
            patch.setattr(module, "host_now", clock.now)
        cameras, buffers = RingCameras(rings), TripletBuffers(RIG.triplet_shape, 12 + limit)
        assembler, latency = Assembler(RIG, rings, buffers), LatencyHistogram()
        preroll, reports = Preroll(buffers, seconds, limit), list[RecorderReport]()
        recordings = Recordings(assembler, preroll, publisher, latency, lambda: 0, reports.append)
        yield Recorder(cameras, assembler, buffers, preroll, recordings, clock, path, latency, reports)
        recordings.wind_up(plain("the test is over"), 10.0)
        while len(preroll):
            preroll.drop()
        assert buffers.free_count == buffers.count, "every slot came back"
        buffers.close()


def _pulses(path: Path) -> list[int]:
    """Check tags and pixels of a log; returns the test's numbers of its pulses."""
    report = verify(path)
    assert report.verdict != "damaged", report.findings
    found: list[int] = []
    first = None
    for number, (tag, image) in enumerate(triplets(path), 1):
        first = tag.time if first is None else first
        pulse = round((_device_time(tag.cameras) - START) / PERIOD)
        assert (tag.pulse, tag.recording, tag.session) == (number, path.stem, "s")
        assert round((tag.time - first) / PERIOD) == pulse - (found[0] if found else pulse)
        columns = np.cumsum([0, *(width for width, _ in SIZES)])
        for camera, part in enumerate(tag.cameras):
            expected = grey(pulse, camera) if part.status is FrameStatus.OK else 0
            assert set(np.unique(image[:, columns[camera] : columns[camera + 1]])) == {expected}
        found.append(pulse)
    return found


def _device_time(cameras: Any) -> int:
    return next(int(camera.device_time) for camera in cameras if camera.device_time is not None)


def _expose(recorder: Recorder, first: int, last: int) -> None:
    for pulse in range(first, last + 1):
        recorder.expose(pulse, 0, 1, 2)
        recorder.step()


def test_what_has_just_happened_is_saved(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        _expose(recorder, 1, 60)
        assert len(recorder.preroll) == 30
        assert recorder.preroll.health(recorder.clock.now()).seconds == pytest.approx(0.98, abs=0.03)
        path = recorder.start(0.5, seconds=0)
        started = recorder.reports[-1]
        assert isinstance(started, RecordingStarted)
        _expose(recorder, 61, 62)
        finished = recorder.finish()
    assert _pulses(path) == list(range(46, 61))
    tag = next(triplets(path))[0]
    assert started.first_pulse == finished.first_pulse == tag.time
    assert finished.counts.pulses == 15


def test_the_past_is_followed_by_the_present_without_a_seam(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        _expose(recorder, 1, 40)
        path = recorder.start(None, pulses=20)
        _expose(recorder, 41, 65)
        recorder.finish()
    assert _pulses(path) == list(range(11, 61)), "pulses are counted from the command"


def test_seconds_count_from_the_command(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        _expose(recorder, 1, 40)
        path = recorder.start(None, seconds=0.5)
        _expose(recorder, 41, 65)
        recorder.finish()
    assert _pulses(path) == list(range(11, 56))


def test_without_a_preroll_a_recording_begins_with_the_command(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        _expose(recorder, 1, 40)
        path = recorder.start(0.0, pulses=5)
        assert recorder.reports[-1] == RecordingStarted(first_pulse=None)
        _expose(recorder, 41, 50)
        recorder.finish()
    assert _pulses(path) == list(range(41, 46))


def test_the_memory_for_the_past_is_bounded(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=10.0, limit=7) as recorder:
        _expose(recorder, 1, 40)
        assert len(recorder.preroll) == 7
        assert recorder.buffers.free_count == 12
        path = recorder.start(None, seconds=0)
        recorder.finish()
    assert _pulses(path) == list(range(34, 41))


def test_hundreds_of_pulses_are_written_in_slices_while_new_ones_come(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=10.0, limit=300) as recorder:
        _expose(recorder, 1, 300)
        path = recorder.start(None, pulses=30)
        turns, pulse = 0, 300
        while recorder.recordings.running:
            turns += 1
            if pulse < 331 and turns % 3 == 0:
                pulse += 1
                recorder.expose(pulse, 0, 1, 2)
            before = recorder.clock.time
            recorder.step()
            assert recorder.clock.time - before < 8 * MS, "no turn takes long"
            wait_until(recorder.has_room, "the disk takes something", timeout_s=30, poll_s=0.001)
        assert turns > 10
    assert _pulses(path) == list(range(1, 331))


def test_pulses_without_any_frame_keep_their_tags(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        _expose(recorder, 1, 10)
        recorder.expose(11)  # lost by all; the cameras' ids tell of it
        _expose(recorder, 12, 25)
        assert sum(held.triplet.slot is None for held in recorder.preroll) == 1
        path = recorder.start(None, seconds=0)
        recorder.finish()
    report = verify(path)
    assert (report.verdict, report.ledger.pulses, report.ledger.complete) == ("partial", 25, 24)
    assert [
        (run.first, run.last, {status.value for _, status in run.cameras}) for run in report.ledger.failed.runs
    ] == [(11, 11, {"lost"})]


def test_what_happened_during_the_preroll_stands_in_the_log(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        recorder.recordings.happened(Event.now(Level.INFO, "K1", plain("long ago")))
        _expose(recorder, 1, 60)
        recorder.recordings.happened(Event.now(Level.ERROR, "K2", plain("gone: unplugged")))
        recorder.recordings.health(b'{"free_triplets":3}')
        first = recorder.start(None, seconds=0)
        recorder.finish()
        _expose(recorder, 61, 70)
        second = recorder.start(None, seconds=0)
        recorder.finish()
    messages = [event.message.partition(":")[0] for event in verify(first).events]
    assert messages == ["gone", "recording 0 started", "recording stopped"]
    with LogReader(first) as reader:
        assert [bytes(m.data or b"") for m in reader.messages("/health")] == [b'{"free_triplets":3}']
    assert verify(second).events[0].message == "recording 1 started"
    assert _pulses(second) == list(range(61, 71)), "nothing is in two recordings"


def test_events_of_a_recording_have_its_times_live_too(tmp_path: Path, publisher: Publisher) -> None:
    """The computer's clock is set a year ahead meanwhile: subscribers and log are told the same times."""
    later = UtcNs(time.time_ns() + 365 * 86400 * NS_PER_S)
    with (
        _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder,
        subscriber(publisher.address, b"event") as sub,
    ):
        wait_until(lambda: publisher._wanted(b"event"), "somebody has subscribed")
        recorder.recordings.happened(Event.at(UtcNs(5), Level.INFO, "K1", plain("before it")))
        _expose(recorder, 1, 10)
        path = recorder.start(None)
        recorder.recordings.happened(Event.at(later, Level.ERROR, "K2", plain("gone")))
        recorder.recordings.stop()
        recorder.finish()
        recorder.start(None)
        recording = recorder.recordings._recording
        assert recording is not None
        assert recording.log is not None
        recording.log.give_up(StorageError("the disk fails: see to it"))
        recorder.finish()
        messages = ["before it", "recording 0 started", "gone", "recording stopped", "recording 1 started"]
        heard = [json.loads(sub.recv_multipart()[1]) for _ in (*messages, "the disk fails")]
        begun = recorder.reports[0]
    assert isinstance(begun, RecordingStarted)
    assert begun.first_pulse is not None
    assert [event["message"].partition(":")[0] for event in heard] == [*messages, "the disk fails"]
    times = [int(event["time_ns"]) for event in heard]
    assert times[0] == 5
    assert all(abs(at - begun.first_pulse) < 5 * NS_PER_S for at in times[1:])
    with LogReader(path) as reader:
        written = [Event.from_protobuf(bytes(m.data or b"")) for m in reader.messages("/events")]
    assert [event.time for event in written[1:]] == times[1:4]  # the first is from before the recording


def test_a_failing_disk_leaves_the_rest_of_the_past_for_another_try(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=10.0, limit=100) as recorder:
        _expose(recorder, 1, 80)
        recorder.start(None, seconds=0)
        recording = recorder.recordings._recording
        assert recording is not None
        assert recording.log is not None
        recording.log.give_up(StorageError("the disk fails: see to it"))
        failed = recorder.finish()
        assert failed.failure is not None
        assert "the disk fails" in failed.failure.said.text
        path = recorder.start(None, seconds=0)
        recorder.finish()
    assert _pulses(path) == list(range(failed.counts.pulses + 1, 81))


def test_a_recording_that_somebody_has_stopped_is_forgotten_in_no_log(tmp_path: Path, publisher: Publisher) -> None:
    """Its file vanishes just after the stop, and the rest goes into another log."""
    with _recorder(tmp_path, publisher, seconds=10.0, limit=100) as recorder:
        _expose(recorder, 1, 20)
        first = recorder.start(None, seconds=100.0, nobody_stops=True)
        recording = recorder.recordings._recording
        assert recording is not None
        recorder.recordings.stop()
        recording.opening.give_up(FileVanishedError("it was deleted: record again"))
        report = recorder.finish()
    assert report.path != first
    with LogReader(report.path) as reader:
        assert list(reader.items())
        assert FORGOTTEN not in reader.metadata[RECORDING_METADATA]


@pytest.mark.parametrize(("limit", "first"), [(100, 14), (8, 51)])
def test_a_mishap_leaves_its_pulses_to_the_next_recording(
    tmp_path: Path, publisher: Publisher, limit: int, first: int
) -> None:
    """As many as memory for the past has room for; those that come meanwhile never wait for them."""
    with _recorder(tmp_path, publisher, seconds=1.5, limit=limit) as recorder:
        _expose(recorder, 1, 40)
        mishap = recorder.start(None, keep_s=3.0)
        for pulse in range(41, 51):
            _expose(recorder, pulse, pulse)
            wait_until(recorder.has_room, "the disk takes something", timeout_s=30, poll_s=0.001)
        recorder.recordings.stop(keep=True)
        recorder.finish()
        _expose(recorder, 51, 54)
        whole = recorder.start(None, keep_s=0.1)
        _expose(recorder, 55, 64)

        def all_free() -> bool:
            recorder.recordings.work(HostNs(recorder.clock.time))
            return recorder.buffers.free_count == recorder.buffers.count

        wait_until(all_free, "after the first seconds nothing is kept", timeout_s=30, poll_s=0.001)
        recorder.recordings.stop(keep=True)
        recorder.finish()
    found, again = _pulses(mishap), _pulses(whole)
    assert (found[-1], again[-1]) == (50, 64)
    assert again == list(range(again[0], 65)), "every pulse once, without a seam"
    assert again[0] <= first


def test_only_pulses_of_the_present_count_as_latency(tmp_path: Path, publisher: Publisher) -> None:
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        _expose(recorder, 1, 30)
        assert recorder.latency.figures().count == 30
        recorder.start(None, pulses=5)
        _expose(recorder, 31, 40)
        recorder.finish()
        found = recorder.latency.figures()
    assert found.count == 40
    assert found.buckets_s["+Inf"] == 40
    assert list(found.buckets_s.values()) == sorted(found.buckets_s.values())
    assert found.buckets_s["0.5"] == 40


def test_the_rig_file_bounds_the_memory() -> None:
    assert preroll_triplets(ring_rig(), 5.0, 1_000_000) == 150
    assert preroll_triplets(ring_rig(preroll_limit_mb=20), 5.0, 1_000_000) == 20
    assert preroll_triplets(ring_rig(preroll_limit_mb=0), 5.0, 1_000_000) == 0
    assert preroll_triplets(ring_rig(), 0.0, 1_000_000) == 0


Step = tuple[str, Any]
CAMERAS = st.sampled_from([(0, 1, 2)] * 6 + [(0, 2), (1,), (0, 1)])
STEPS: st.SearchStrategy[Step] = st.one_of(
    st.tuples(st.just("pulses"), st.lists(CAMERAS, min_size=1, max_size=8)),
    st.tuples(st.just("pulses"), st.lists(CAMERAS, min_size=1, max_size=8)),
    st.tuples(st.just("turns"), st.integers(1, 3)),
    st.tuples(st.just("start"), st.sampled_from([None, 0.0, 0.05, 0.12, 0.3, 9.0])),
    st.tuples(st.just("start"), st.sampled_from([None, 0.1])),
    st.tuples(st.just("stop"), st.none()),
)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(STEPS, min_size=3, max_size=25))
def test_every_pulse_comes_once_and_in_order(
    tmp_path: Path, publisher: Publisher, tmp_path_factory: pytest.TempPathFactory, steps: list[Step]
) -> None:
    """A recording has all pulses from its first one that is still held to the last one before its end."""
    folder = tmp_path_factory.mktemp("logs")
    with _recorder(folder, publisher, seconds=0.25, limit=6) as recorder:
        pulse, ended_with = 0, 0
        expected: dict[Path, tuple[int, int]] = {}
        path = None
        for kind, what in [*steps, ("stop", None), ("pulses", [(0, 1, 2)] * 6)]:
            if kind == "pulses":
                for cameras in what:
                    pulse += 1
                    recorder.expose(pulse, *cameras)
                    recorder.step()
            elif kind == "turns":
                for _ in range(what):
                    recorder.step()
            elif kind == "start" and not recorder.recordings.running:
                recorder.step()
                held = [_number(held.triplet.pulse.time) for held in recorder.preroll]
                undecided = held[-1] + 1 if held else ended_with + 1
                path = recorder.start(what)
                begin = recorder.clock.time - (10**12 if what is None else round(what * 1e9))
                candidates = [*held, *range(undecided, pulse + 1)]
                first = next((n for n in candidates if recorder.cameras.time(n) >= begin), pulse + 1)
                expected[path] = (first, pulse)
            elif kind == "stop" and recorder.recordings.running and path is not None:
                recorder.recordings.stop()
                expected[path] = (expected[path][0], pulse)
                ended_with = pulse
                # Whole pulses decide what is open, and what comes after belongs to nobody, or to the next one.
                for _ in range(3):
                    pulse += 1
                    recorder.expose(pulse, 0, 1, 2)
                    recorder.step()
                recorder.finish()
    for path, (first, last) in expected.items():
        assert _pulses(path) == list(range(first, last + 1))


def _number(time: int) -> int:
    return round((time - START) / PERIOD)


@pytest.mark.parametrize("wind_up", [False, True])
def test_pulses_by_hand_are_all_in_the_log_however_the_recording_ends(
    tmp_path: Path, publisher: Publisher, wind_up: bool
) -> None:
    """An incomplete pulse waits for the next ones, which tell why; it does not wait beyond the end of its recording."""
    presses = [10, 21, 47, 60, 88, 102]
    with _recorder(tmp_path, publisher, seconds=1.0, limit=100) as recorder:
        path = recorder.start(0)
        for index, pulse in enumerate(presses):
            recorder.expose(pulse, *((0, 1, 2) if index < 5 else (0, 2)))
            recorder.step()
        recorder.clock.advance_to(recorder.cameras.time(presses[-1]) + 2 * recorder.assembler.hold_ns)
        recorder.step()
        assert recorder.assembler.pairer.health().open == 1
        if wind_up:
            recorder.recordings.wind_up(plain("test"), 10.0)
            report = recorder.reports[-1]
        else:
            recorder.recordings.stop()
            report = recorder.finish()
    assert isinstance(report, RecordingFinished)
    assert (report.counts.pulses, report.counts.complete, report.pauses) == (6, 5, ())
    assert _pulses(path) == presses
