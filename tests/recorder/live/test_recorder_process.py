"""The recorder process with the real other processes: pre-roll, preview, health records, and its death."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import jsonschema
import pytest
import zmq

from recorder.checking.verify import verify
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.clocks import NS_PER_S, UtcAnchor, UtcNs, host_now
from rig.errors import BadInputError, ProcessDiedError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.health import HEALTH_SCHEMA, Health
from rig.jumper import JumperState
from rig.pulse import PulseNumber
from rig.settings.model import RigSettings
from rig.topics import JUMPER
from rig.transport.preview import PreviewSlot
from rig.transport.recorder_commands import RecorderOptions, StartRecording, TellEvent, TellResult
from rig.transport.recorder_reports import (
    CameraChanged,
    CameraNews,
    RecorderFailed,
    RecorderHealth,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
)
from service.processes.rig_processes import RigProcesses, RigReport
from service.processes.rig_programs import RECORDER
from service.processes.simulation import simulated_hill
from tests.capture.rigs import make_rig
from tests.recorder.logs import jumper_state
from tests.support.loopback import Loopback
from tests.support.stamps import hill_pulses
from tests.support.waiting import wait_until

T = TypeVar("T")
WAIT_S = 60.0


@dataclass
class Running:
    """The processes of a rig, and the recorder's reports."""

    rig: RigSettings
    processes: RigProcesses
    preview: PreviewSlot
    folder: Path
    reports: list[RigReport] = field(default_factory=list)

    def turn(self) -> None:
        """Receive reports."""
        self.reports += self.processes.turn(0.05)

    def until(self, what: str, done: Callable[[], Any]) -> None:
        """Receive reports until a condition is true."""

        def turned() -> bool:
            self.turn()
            return bool(done())

        wait_until(turned, what, timeout_s=WAIT_S, poll_s=0.0)

    def last(self, kind: type[T]) -> T | None:
        """The last report of this kind."""
        return next((report for report in reversed(self.reports) if isinstance(report, kind)), None)

    def start(self, name: str, **order: Any) -> Path:
        """Start a recording."""
        path = self.folder / f"{name}.mcap"
        self.processes.tell(StartRecording(path=path, session={}, **order))
        return path

    def finished(self, path: Path) -> RecordingFinished:
        """Wait for the end of a recording; returns the recorder's report."""

        def is_there() -> bool:
            report = self.last(RecordingFinished)
            return report is not None and report.path == path

        self.until(f"{path.name} is finished", is_there)
        report = self.last(RecordingFinished)
        assert report is not None
        return report

    def health(self) -> Health | None:
        """The last health report since the reports were cleared."""
        report = self.last(RecorderHealth)
        return None if report is None else report.health

    def pulses(self) -> int:
        """Pulses that the recorder has counted."""
        health = self.health()
        return 0 if health is None else health.pairing.pulses

    def held_s(self) -> float:
        """Length of the pre-roll held now, s."""
        health = self.health()
        return 0.0 if health is None else health.preroll.seconds

    def connected(self) -> set[int]:
        """Cameras that were reported as connected since the reports were cleared."""
        changes = (report for report in self.reports if isinstance(report, CameraChanged))
        return {change.camera for change in changes if change.news is CameraNews.CONNECTED}

    def let_pass(self, pulses: int) -> None:
        """Wait for so many pulses."""
        until = self.pulses() + pulses
        self.until(f"{pulses} pulses pass", lambda: self.pulses() >= until)


@contextmanager
def _running(folder: Path, loopback: Loopback, *, preroll_s: float = 4.0) -> Iterator[Running]:
    rig, epoch = make_rig(folder, "sim", loopback), host_now()
    preview = PreviewSlot.create(rig.triplet_shape, len(rig.cameras))
    options = RecorderOptions(preroll_s=preroll_s, directory=folder, preview=preview.fd)
    with (
        simulated_hill(rig, epoch),
        RigProcesses(rig, lambda _: None, epoch=epoch, recorder=options) as processes,
    ):
        running = Running(rig, processes, preview, folder)
        running.until("whole triplets come", lambda: processes.seen.warm)
        yield running
    preview.close()


def _is_sound(path: Path) -> None:
    """Every pulse has its tag, and most of them their frames: a machine that is overloaded may lose some."""
    report = verify(path)
    assert report.verdict != "damaged", report.findings
    assert report.ledger.complete > report.ledger.pulses // 2


def test_the_last_three_seconds_are_saved_and_the_next_recording_goes_on(tmp_path: Path, loopback: Loopback) -> None:
    with _running(tmp_path, loopback) as running:
        running.let_pass(135)  # the past from before all cameras were there is forgotten
        assert running.held_s() == pytest.approx(4.0, abs=0.3)
        past = running.start("past", preroll_s=3.0, seconds=0)
        report = running.finished(past)
        started = running.last(RecordingStarted)
        assert started is not None
        running.until("1 s is held again", lambda: 1.0 < running.held_s() < 3.0)
        both = running.start("both", preroll_s=None, pulses=30, seconds=1)
        running.finished(both)
    assert 88 <= report.counts.pulses <= 91
    assert report.bytes == past.stat().st_size
    for path in (past, both):
        _is_sound(path)
        hill = hill_pulses(path, running.rig)
        steps = {min(seen) - pulse for pulse, seen in hill.items() if seen}
        assert len(steps) == 1, "no pulse is left out, none comes twice"
        assert {tag.recording for tag, _ in triplets(path)} == {path.stem}
    tags = [tag for tag, _ in triplets(past)]
    assert started.first_pulse == report.first_pulse == tags[0].time
    assert verify(both).ledger.pulses > 30 + 25
    assert next(triplets(both))[0].time > tags[-1].time, "no pulse is in two recordings"


def test_names_that_are_too_long_for_the_log_are_refused_and_the_recorder_goes_on(
    tmp_path: Path, loopback: Loopback
) -> None:
    with _running(tmp_path, loopback) as running:
        long, path = tmp_path / "long.mcap", tmp_path / "short.mcap"
        running.processes.tell(StartRecording(path=long, session={"session": "x" * 9000}, pulses=30))
        running.until("it is refused", lambda: running.last(RecorderFailed))
        failed = running.last(RecorderFailed)
        assert failed is not None
        assert isinstance(failed.error(), BadInputError)
        assert "bytes too many for the tags of the log: shorten them" in failed.said.text
        assert not long.exists()
        running.processes.tell(StartRecording(path=path, session={"session": "𝄞" * 200}, pulses=30))
        assert running.finished(path).counts.pulses >= 30
    _is_sound(path)


def test_subscribers_get_the_past_without_a_gap(tmp_path: Path, loopback: Loopback) -> None:
    with (
        _running(tmp_path, loopback) as running,
        zmq.Context() as context,
        context.socket(zmq.SUB) as socket,
    ):
        socket.subscribe(b"triplet")
        socket.connect(running.rig.network.publish)
        running.let_pass(135)
        path = running.start("past", preroll_s=None, seconds=0)
        pulses = running.finished(path).counts.pulses
        assert pulses > 100
        got: list[int] = []
        while len(got) < pulses and socket.poll(10_000):
            _, tag, image = socket.recv_multipart()
            got.append(json.loads(tag)["pulse"])
            assert len(image) == 480 * 1920
    assert got == list(range(1, pulses + 1))


def test_results_reach_the_log_of_their_recording_and_subscribers(tmp_path: Path, loopback: Loopback) -> None:
    with (
        _running(tmp_path, loopback) as running,
        zmq.Context() as context,
        context.socket(zmq.SUB) as socket,
    ):
        socket.subscribe(b"jumper")
        socket.subscribe(b"health")
        socket.connect(running.rig.network.publish)
        assert socket.poll(10_000), "a first message proves the subscription"
        path = running.start("jump", pulses=45)
        running.until("the log is open", lambda: running.last(RecordingStarted) is not None)
        for recording in ("jump", "another"):
            state = jumper_state(7, recording)
            running.processes.tell(
                TellResult(
                    recording=recording, topic=JUMPER.name, pulse=PulseNumber(7), time=state.time, data=state.encode()
                )
            )
        running.finished(path)
        got: list[bytes] = []
        while len(got) < 2 and socket.poll(10_000):
            topic, data = socket.recv_multipart()
            got += [data] if topic == b"jumper" else []
    assert [JumperState.decode(data).recording for data in got] == ["jump", "another"]
    with LogReader(path) as reader:
        kept = [JumperState.decode(message.data or b"") for message in reader.messages("/jumper")]
    assert kept == [jumper_state(7, "jump")]


def test_an_event_stands_at_its_moment_whatever_the_clock_of_the_computer_says(
    tmp_path: Path, loopback: Loopback
) -> None:
    with _running(tmp_path, loopback) as running:
        path = running.start("jump", pulses=45)
        running.until("the log is open", lambda: running.last(RecordingStarted) is not None)
        week_ago = UtcNs(UtcAnchor.take().utc(host_now()) - 7 * 86400 * NS_PER_S)
        running.processes.tell(TellEvent(event=Event(week_ago, Level.INFO, "service", "by a clock that was set back")))
        running.finished(path)
    report = verify(path)
    assert [event.message for event in report.events].count("by a clock that was set back") == 1
    first, last = report.ledger.first_time, report.ledger.last_time
    assert first is not None
    assert last is not None
    assert all(first - 60 * NS_PER_S < event.time < last + 60 * NS_PER_S for event in report.events)
    assert report.off_time == ()


def test_health_says_everything_and_keeps_its_schema(tmp_path: Path, loopback: Loopback) -> None:
    with _running(tmp_path, loopback) as running:
        running.let_pass(60)
        path = running.start("jump", preroll_s=None, pulses=45)
        running.finished(path)
        health = running.processes.seen.health
    with LogReader(path) as reader:
        records = [json.loads(bytes(message.data or b"")) for message in reader.messages("/health")]
    assert len(records) >= 2, "that of the past and of the present"
    for record in records:
        jsonschema.validate(record, HEALTH_SCHEMA)
        _has_exactly(record, HEALTH_SCHEMA)
    assert health is not None
    assert health.disk.free_bytes == pytest.approx(os.statvfs(tmp_path).f_bavail * 4096, rel=0.2)
    assert health.preroll.limit_s == 4.0
    assert health.preroll.memory_mb == pytest.approx(120 * 0.93, rel=0.01)
    assert health.latency.count > 40
    for camera in health.cameras:
        assert abs(camera.clock_offset_us or 0.0) < 1000
        assert camera.temperature_c is None or 0 < camera.temperature_c < 100


def _has_exactly(record: dict[str, Any], schema: dict[str, Any]) -> None:
    """Every field is described, every described field is there."""
    assert set(record) == set(schema["properties"])
    for name, described in schema["properties"].items():
        is_list = described.get("type") == "array"
        value, inner = (record[name][0], described["items"]) if is_list else (record[name], described)
        if isinstance(value, dict) and "properties" in inner:
            _has_exactly(value, inner)


def test_people_see_what_the_cameras_see_while_they_ask_for_it(tmp_path: Path, loopback: Loopback) -> None:
    with _running(tmp_path, loopback) as running:
        assert running.preview.read() is None, "nobody has asked"
        running.preview.want(WAIT_S)
        running.until("an image is there", lambda: running.preview.newest() > 0)
        image = running.preview.read()
        assert image is not None
        assert image.statuses == (FrameStatus.OK,) * 3
        seen = {image.pulse}

        def look() -> int:
            seen.add(running.preview.newest())
            return len(seen)

        running.until("images follow each other", lambda: look() > 10)
        assert max(seen) - min(seen) >= 2 * (len(seen) - 1), "not every pulse is shown"
        running.preview.want(0)
        path = running.start("jump", preroll_s=None, seconds=0)
        running.finished(path)
        assert running.preview.newest() - max(seen) <= 4


def test_a_recorder_started_anew_goes_on_where_the_killed_one_was(tmp_path: Path, loopback: Loopback) -> None:
    with _running(tmp_path, loopback) as running:
        running.preview.want(WAIT_S)
        broken = running.start("broken")
        running.until(
            "it has been recording for a while",
            lambda: (progress := running.last(RecordingProgress)) and progress.counts.pulses > 60,
        )
        os.kill(running.processes.pids[RECORDER], signal.SIGKILL)
        with pytest.raises(ProcessDiedError, match="killed by SIGKILL"):
            running.until("its death is noticed", lambda: False)
        running.reports.clear()
        running.processes.restart_recorder()
        running.until("whole triplets come again", lambda: running.processes.seen.warm)
        running.until("all cameras are known again", lambda: running.connected() == {0, 1, 2})
        after = running.start("after", preroll_s=0.0, pulses=60)
        running.finished(after)
        running.until(
            "slots that the dead one had in hand are free",
            lambda: (health := running.health()) and all(camera.slots_queued <= 2 for camera in health.cameras),
        )
        assert running.processes.seen.restarts == {"K1": 0, "K2": 0, "K3": 0}
        image = running.preview.read()
        assert image is not None
        assert image.pulse < 1000
    assert verify(after).ledger.pulses == 60
    _is_sound(after)
    left = verify(broken)
    assert not left.closed
    assert left.ledger.pulses > 50
    assert not left.ledger.missing
