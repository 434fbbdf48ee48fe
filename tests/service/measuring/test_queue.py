"""Logs wait to be measured, are measured one after the other, and none is forgotten."""

import json
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import av
import pytest
from pydantic import ValidationError

from analysis.report.kinogram.earlier import read_earlier
from bench.analysis.hill_logs import HillLog
from recorder.catalogue.folder import Catalogue
from recorder.log.beside import measured_path
from recorder.log.session_changes import write_session_changes
from rig.api.jump import LastJump
from rig.api.measuring import Measurement, MeasuringState
from rig.errors import StateForbidsError, StorageError
from rig.events import Event
from rig.settings.model import AnalysisSettings, OffloadSettings
from service.measuring.queue import Measurings
from service.measuring.waiting import NAME
from service.offloading.releasing import Removal
from service.recordings import live_results
from service.recordings.measured_jumps import LogJudge, MeasuredJumps
from tests.analysis.simulated import training
from tests.recorder.logs import write_log
from tests.support.kept import kept_hill_log
from tests.support.other_disk import other_disk
from tests.support.rigs import SIM
from tests.support.waiting import wait_until

#: A measuring gets only the processor time that nobody else wants.
PATIENCE_S = 120
OVER = (MeasuringState.DONE, MeasuringState.FAILED)


@pytest.fixture(scope="module")
def hill() -> HillLog:
    """One jump; the jumper is in sight from hill pulse 23 to 60. Not to be changed."""
    return kept_hill_log(training(), range(16, 66))


class Bench:
    """A folder of recordings with its queue.

    Attributes:
        folder: it.
        busy: whether a recording runs.
        survey: what the rig file names; None: it has no `[analysis]`.
        further: what else stands under `[analysis]`.
        copied_to: folder that `[offload]` names; None: there is no such table.
        keep_free_GB: its rule.
        found: recordings whose jumps were told.
        shown: what was known of each of them then.
        said: the events.
        earlier: gives the results of the same athlete's other logs.
    """

    def __init__(self, folder: Path, survey: Path | None) -> None:
        self.folder, self.busy, self.survey = folder, False, survey
        self.further: dict[str, Any] = {}
        self.copied_to: Path | None = None
        self.keep_free_GB: float | None = None
        self.found: list[str] = []
        self.shown: list[Measurement] = []
        self.said: list[str] = []
        self.catalogue = catalogue = Catalogue(folder, LogJudge())
        self.removal = Removal(catalogue.delete, lambda: catalogue.trash().bytes, lambda: True)
        self.earlier: Callable[[str], list[Path]] = MeasuredJumps(catalogue).others_of_athlete

    @contextmanager
    def running(self) -> Iterator[Measurings]:
        """A service that measures."""
        with self.queue() as self._queue:
            yield self._queue

    def queue(self) -> Measurings:
        """Its queue, not yet at work."""
        analysis = self.survey and AnalysisSettings(survey=self.survey, **self.further)
        offload = self.copied_to and OffloadSettings(to=self.copied_to, keep_free_GB=self.keep_free_GB)
        rig = SIM.model_copy(update={"analysis": analysis, "offload": offload})
        return Measurings(
            self.folder,
            lambda: rig,
            lambda: self.busy,
            self.earlier,
            self._hear,
            self._know,
            lambda: None,
            self.removal,
        )

    def log(self, recording: str) -> Path:
        """The log of a recording."""
        return self.folder / f"{recording}.mcap"

    def of(self, queue: Measurings, recording: str) -> Measurement:
        """How far it is."""
        return queue.measurement(recording, self.log(recording))

    def until_over(self, queue: Measurings, recording: str) -> Measurement:
        """Wait until a recording is measured, or cannot be."""
        wait_until(lambda: self.of(queue, recording).state in OVER, f"{recording} is measured", PATIENCE_S, 0.05)
        return self.of(queue, recording)

    def waiting(self) -> list[str]:
        """The queue on the disk."""
        path = self.folder / NAME
        found: list[str] = json.loads(path.read_text()) if path.exists() else []
        return found

    def _hear(self, event: Event) -> None:
        self.said.append(event.message)

    def _know(self, jumps: tuple[LastJump, ...]) -> None:
        self.found += [jump.recording for jump in jumps]
        self.shown += [self.of(self._queue, jump.recording) for jump in jumps]


@pytest.fixture
def bench(tmp_path: Path, hill: HillLog) -> Iterator[Bench]:
    shutil.copy(hill.path, tmp_path / "jump.mcap")
    made = Bench(tmp_path, hill.survey)
    with closing(made.catalogue):
        yield made


@pytest.mark.long
@pytest.mark.alone
def test_a_log_is_measured_after_the_end_of_its_recording_with_everything_beside_it(bench: Bench) -> None:
    bench.busy = True
    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        wait_until(lambda: bench.waiting() == ["jump"], "it stands in the queue", poll_s=0.01)
        assert bench.of(queue, "jump").state is MeasuringState.WAITING
        assert queue.view.waiting == 1
        bench.busy = False
        done = bench.until_over(queue, "jump")
    assert done.state is MeasuringState.DONE, done.problem
    (jump,) = done.figures
    assert jump.ok, jump.verdict
    assert (jump.recording, bench.found, bench.waiting()) == ("jump", ["jump"], [])
    (early,) = bench.shown  # the figures do not wait until pages and pictures are written
    assert (early.state, early.figures, early.files, early.live) == (MeasuringState.MEASURING, (jump,), (), False)
    assert jump.takeoff_speed is not None
    assert abs(jump.takeoff_speed.value - 26.1) < 1.0
    assert {"report.html", "jumper.c3d", "jumper.trc", "jumper.csv", "jumper.json", "protocol.html"} <= set(done.files)
    assert {"kinogram.html", "kinogram.jpg", "kinogram.json"} <= set(done.files)
    assert [earlier.ok for earlier in read_earlier(measured_path(bench.log("jump")))] == [True]
    assert live_results.latest(bench.folder) == jump
    _a_corrected_name_reaches_every_file(bench)
    assert live_results.takeoff_pulse(bench.log("jump")) == pytest.approx(30 - 16 + 1, abs=1)
    catalogue = bench.catalogue
    catalogue.delete("jump")
    assert not measured_path(bench.log("jump")).exists()
    catalogue.restore("jump")
    assert (measured_path(bench.log("jump")) / "report.html").stat().st_size > 10_000
    _a_failure_leaves_the_result(bench)
    catalogue.delete("jump")
    catalogue.purge()
    assert sorted(path.name for path in bench.folder.rglob("*") if path.is_file() and "jump" in path.name) == []


def _a_corrected_name_reaches_every_file(bench: Bench) -> None:
    log, folder = bench.log("jump"), measured_path(bench.log("jump"))
    untouched = (folder / "jumper.c3d").stat().st_mtime_ns
    bench.busy = True
    write_session_changes(log, {"athlete": "Kari Ås", "note.3": "of a pulse"})
    with bench.running() as queue:
        queue.renamed("jump", log)
        now = bench.of(queue, "jump")
        assert (now.state, now.renaming) == (MeasuringState.DONE, True)
        assert {"report.html", "jumper.json", "kinogram.html", "kinogram.jpg"}.isdisjoint(now.files)
        assert "jumper.c3d" in now.files
        bench.busy = False
        wait_until(lambda: not bench.of(queue, "jump").renaming, "the name is written", PATIENCE_S, 0.05)
    for name in ("report.html", "kinogram.html", "jumper.json"):
        text = (folder / name).read_text(encoding="utf-8")
        assert "Kari Ås" in text, name
    assert [path.name for path in folder.iterdir() if b"Anna" in path.read_bytes()] == []
    assert (folder / "jumper.c3d").stat().st_mtime_ns == untouched, "nothing is measured again"
    write_session_changes(log, {"athlete": "Berit", "note.3": "of a pulse"})  # while no service runs
    with bench.running() as queue:
        wait_until(lambda: not bench.of(queue, "jump").renaming, "the service that starts finds it", PATIENCE_S, 0.05)
    assert [earlier.athlete for earlier in read_earlier(folder)] == ["Berit"]


def _a_failure_leaves_the_result(bench: Bench) -> None:
    bench.survey = bench.folder / "misspelt.json"
    with bench.running() as queue:
        queue.want("jump", bench.log("jump"))
        wait_until(lambda: bench.of(queue, "jump").problem is not None, "it failed", PATIENCE_S, 0.05)
        failed = bench.of(queue, "jump")
    assert failed.state is MeasuringState.FAILED
    assert failed.problem is not None
    assert "misspelt.json" in failed.problem.text
    assert len(failed.figures) == 1
    assert "report.html" in failed.files


def test_a_service_that_ends_in_the_middle_goes_on_when_it_is_started_again(bench: Bench) -> None:
    write_log(bench.log("other"))
    with bench.running() as queue:
        queue.opened(bench.log("other"))
        queue.opened(bench.log("jump"))  # the last one comes first: people at the hill look at it
        wait_until(lambda: queue.view.state is MeasuringState.MEASURING, "it is being measured", PATIENCE_S, 0.01)
    assert bench.waiting() == ["jump", "other"]
    assert not measured_path(bench.log("jump")).exists()
    with bench.running() as queue:
        wait_until(lambda: queue.view.recording == "jump", "it goes on", PATIENCE_S, 0.01)
        queue.give_up("jump", bench.log("jump"))
        assert bench.until_over(queue, "other").state is MeasuringState.FAILED
        assert bench.of(queue, "jump").state is MeasuringState.NONE
    assert bench.waiting() == []
    assert not list((bench.folder / ".measuring").iterdir())


def test_what_is_recorded_while_a_log_is_measured_is_in_the_queue_of_a_service_that_is_killed(bench: Bench) -> None:
    write_log(bench.log("other"))
    with bench.running() as queue:
        queue.want("jump", bench.log("jump"))
        wait_until(lambda: queue.view.step is not None, "it is under way", PATIENCE_S, 0.01)
        bench.busy = True
        wait_until(lambda: queue.view.paused, "it stands still", PATIENCE_S, 0.01)
        queue.opened(bench.log("other"))
        wait_until(lambda: bench.waiting() == ["other", "jump"], "both are on the disk")
        assert queue.view.recording == "jump"


def test_a_recording_that_was_deleted_before_it_was_measured_is_measured_when_it_comes_back(bench: Bench) -> None:
    catalogue = bench.catalogue
    bench.busy = True
    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        catalogue.delete("jump")
        bench.busy = False
        wait_until(lambda: queue.view.waiting == 0, "it waits no more")
        bench.busy = True
        catalogue.restore("jump")
        queue.restored("jump", bench.log("jump"))
        assert bench.of(queue, "jump").state is MeasuringState.WAITING
        queue.give_up("jump", bench.log("jump"))
        catalogue.delete("jump")
        catalogue.restore("jump")
        queue.restored("jump", bench.log("jump"))
        assert bench.of(queue, "jump").state is MeasuringState.NONE, "it did not wait when it was deleted"


def test_it_stands_still_while_a_recording_runs_and_says_so_if_it_is_killed(bench: Bench) -> None:
    with bench.running() as queue:
        queue.want("jump", bench.log("jump"))
        wait_until(lambda: queue.view.step is not None, "it is under way", PATIENCE_S, 0.01)
        bench.busy = True
        wait_until(lambda: queue.view.paused, "it stands still", PATIENCE_S, 0.01)
        now = bench.of(queue, "jump")
        assert (now.state, now.paused) == (MeasuringState.MEASURING, True)
        os.kill(_child(), signal.SIGKILL)
        failed = bench.until_over(queue, "jump")
    assert failed.problem is not None
    assert "has ended by itself" in failed.problem.text
    assert bench.said == [f"jump is not measured: {failed.problem.text}"]


def _child() -> int:
    """The program that measures, which this process has started."""
    children = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    pids = [pid for path in children for pid in path.read_text().split()]
    (found,) = [pid for pid in pids if b"service.measuring.program" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    return int(found)


def test_what_cannot_be_measured_says_why_and_the_next_one_goes_on(bench: Bench) -> None:
    write_log(bench.log("dark"))
    with bench.running() as queue:
        bench.busy = True
        queue.want("gone", bench.log("gone"))
        queue.want("dark", bench.log("dark"))
        assert bench.of(queue, "dark").before == 1
        bench.busy = False
        failed = bench.until_over(queue, "dark")
    assert failed.problem is not None
    assert failed.problem.text
    assert failed.again, "the survey does not fit what it shows"
    assert (failed.files, failed.figures) == ((), ())
    assert bench.waiting() == []


def test_without_survey_nothing_is_queued_and_who_asks_is_told_what_is_missing(bench: Bench) -> None:
    bench.survey = None
    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        with pytest.raises(StateForbidsError, match=r"give the rig file an \[analysis\] with survey or calibration"):
            queue.want("jump", bench.log("jump"))
        assert bench.of(queue, "jump").state is MeasuringState.NONE
        assert queue.view.waiting == 0


def test_a_queue_that_cannot_be_read_is_said(bench: Bench) -> None:
    (bench.folder / NAME).write_text("{")
    with bench.running():
        wait_until(lambda: bench.said != [], "it is said")
    assert bench.said[0].startswith(f"{NAME}: cannot be read, so logs that waited to be measured are forgotten")


@pytest.mark.timeout(600)  # the program that measures takes what others leave of the processors
@pytest.mark.long
@pytest.mark.alone
def test_after_the_measuring_come_a_video_and_a_copy_on_another_disk(bench: Bench, tmp_path: Path) -> None:
    other = tmp_path / "other disk"
    bench.further, bench.copied_to = {"after_recording": ("measure", "video")}, other
    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        seen, figures = set(), 0
        wait_until(lambda: bench.waiting() == ["jump"], "it stands in the queue")
        while bench.waiting():
            now = bench.of(queue, "jump")
            seen.add(tuple(_states(now)))
            if ("video", "measuring") in _states(now):
                figures = max(figures, len(now.figures))
            wait_until(lambda now=now: bench.of(queue, "jump") != now or not bench.waiting(), "it goes on", PATIENCE_S)  # type: ignore[misc]
        wait_until(lambda: _states(bench.of(queue, "jump"))[-1] == ("copy", "failed"), "there is no disk", PATIENCE_S)
        without_a_disk = bench.of(queue, "jump")
        assert figures == 1, "they do not wait for the video"
        assert not list(tmp_path.glob("other disk*"))  # nothing is made where a disk is not connected
        other.mkdir()
        wait_until(lambda: _states(bench.of(queue, "jump"))[-1] == ("copy", "done"), "it is copied", PATIENCE_S)
        copied = bench.of(queue, "jump")
    assert without_a_disk.state is MeasuringState.DONE
    assert (("measure", "measuring"), ("video", "waiting"), ("copy", "waiting")) in seen
    assert (("measure", "done"), ("video", "measuring"), ("copy", "waiting")) in seen
    assert _states(without_a_disk) == [("measure", "done"), ("video", "done"), ("copy", "failed")]
    problem = without_a_disk.steps[-1].problem
    assert problem is not None
    assert "other disk: the folder for copies is not there" in problem.text
    assert any("jump is not copied" in said for said in bench.said)
    assert _states(copied) == [("measure", "done"), ("video", "done"), ("copy", "done")]
    assert (other / "jump.mcap").read_bytes() == bench.log("jump").read_bytes()
    assert (other / "jump.measured" / "report.html").exists()
    assert not list(other.glob(".*"))
    with av.open(measured_path(bench.log("jump")) / "overlay.mp4") as video:
        assert video.streams.video[0].codec_context.name == "h264"
        assert sum(1 for _ in video.decode(video=0)) > 30


def _states(measurement: Measurement) -> list[tuple[str, str]]:
    return [(each.step.value, each.state.value) for each in measurement.steps]


def test_another_log_of_the_same_name_is_not_written_over(bench: Bench, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "jump.mcap").write_bytes(b"of another computer")
    bench.copied_to, bench.survey = other, tmp_path / "none.json"
    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        over = [("measure", "failed"), ("copy", "failed")]
        wait_until(lambda: _states(bench.of(queue, "jump")) == over, "both are tried", PATIENCE_S)
        failed = bench.of(queue, "jump")
    assert failed.steps[-1].problem is not None
    assert "another log of this name" in failed.steps[-1].problem.text
    assert (other / "jump.mcap").read_bytes() == b"of another computer"


def test_recordings_are_copied_where_nothing_is_measured_and_again_when_they_change(
    bench: Bench, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    bench.copied_to, bench.survey, bench.busy = other, None, True

    def state() -> list[tuple[str, str]]:
        return _states(bench.of(queue, "jump"))

    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        assert state() == [("copy", "waiting")]
        bench.busy = False
        wait_until(lambda: state() == [("copy", "failed")], "there is no disk", PATIENCE_S)
        assert any("jump is not copied: " in said and "is not there" in said for said in bench.said)
        other.mkdir()
        wait_until(lambda: state() == [("copy", "done")], "the disk has come", PATIENCE_S)
    assert (other / "jump.mcap").read_bytes() == bench.log("jump").read_bytes()
    written = (other / "jump.mcap").stat()
    with bench.running() as queue:
        assert state() == [("copy", "done")]
        write_session_changes(bench.log("jump"), {"athlete": "Kari"})
    with bench.running() as queue:
        wait_until((other / "jump.session.json").exists, "the correction is copied", PATIENCE_S)
        wait_until(lambda: state() == [("copy", "done")], "it is noted", PATIENCE_S)
    assert (other / "jump.mcap").stat() == written


def test_a_copy_gives_way_to_a_log_that_waits_to_be_measured(bench: Bench, tmp_path: Path) -> None:
    bench.copied_to = tmp_path
    queue = bench.queue()
    copies = queue._queues.copies
    copies.want("old")
    with queue._now.on("old", copies.waiting):
        assert queue._wanted("old")
        queue.want("jump", bench.log("jump"))
        assert not queue._wanted("old")
        bench.busy = True  # then it only stands still
        assert queue._wanted("old")


def test_a_copied_recording_is_released_where_a_rule_says_so(bench: Bench) -> None:
    frames = bench.log("jump").read_bytes()
    with other_disk() as other:
        bench.copied_to, bench.survey, bench.keep_free_GB = other, None, 1e6
        with bench.running():
            wait_until((bench.folder / ".trash" / "jump.mcap").exists, "it is copied and released", PATIENCE_S)
        assert not bench.log("jump").exists()
        assert (other / "jump.mcap").read_bytes() == frames


def test_nothing_is_done_by_itself_where_nobody_wants_it(bench: Bench) -> None:
    bench.further = {"after_recording": ()}
    with bench.running() as queue:
        queue.opened(bench.log("jump"))
        assert queue.view.waiting == 0
        assert queue.want("jump", bench.log("jump")).state in {MeasuringState.WAITING, MeasuringState.MEASURING}


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"after_recording": ("video",)}, "video comes after measure"),
        ({"after_recording": ("measure", "measure")}, "a step stands twice"),
    ],
)
def test_steps_that_cannot_be_are_refused_with_what_to_write(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        AnalysisSettings(survey=Path("s.json"), **wrong)


def test_a_folder_that_cannot_be_read_fails_the_log_and_the_queue_goes_on(bench: Bench) -> None:
    def refused(recording: str) -> list[Path]:
        raise StorageError(f"{bench.folder}: cannot be read (Input/output error); check the folder's permissions")

    bench.earlier = refused
    shutil.copy(bench.log("jump"), bench.log("another"))
    with bench.running() as queue:
        for recording in ("jump", "another"):
            queue.want(recording, bench.log(recording))
        for recording in ("jump", "another"):
            over = bench.until_over(queue, recording)
            assert over.state is MeasuringState.FAILED
            assert over.problem is not None
            assert "cannot be read (Input/output error)" in over.problem.text
