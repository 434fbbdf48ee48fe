"""The recorder as a process among the real others: past, preview, health, and what follows its death."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import zmq

from recorder.health_schema import HEALTH_SCHEMA
from recorder.log_reader import LogReader, triplets
from recorder.verify import verify
from rig.clocks import host_now
from rig.control import Message
from rig.errors import ProcessDiedError
from rig.frame import FrameStatus
from rig.preview import PreviewSlot
from rig.settings import RigSettings
from svev.rig_processes import RECORDER, RigProcesses
from svev.simulation import simulated_hill
from svev.truth_file import hill_pulses
from tests.capture.rigs import make_rig
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

WAIT_S = 60.0


@dataclass
class Running:
    """The processes of a rig, and what the recorder reported."""

    rig: RigSettings
    processes: RigProcesses
    preview: PreviewSlot
    folder: Path
    reports: list[Message] = field(default_factory=list)

    def turn(self) -> None:
        """Take in reports."""
        self.reports += self.processes.turn(0.05)

    def until(self, what: str, done: Callable[[], Any]) -> None:
        """Take in reports until something is the case."""

        def turned() -> bool:
            self.turn()
            return bool(done())

        wait_until(turned, what, timeout_s=WAIT_S, poll_s=0.0)

    def last(self, report: str) -> Message | None:
        """The last report of this name."""
        return next((message for message in reversed(self.reports) if message["report"] == report), None)

    def start(self, name: str, **order: Any) -> Path:
        """Start a recording."""
        path = self.folder / f"{name}.mcap"
        command: Message = {"command": "start", "path": str(path), "recording": name, "session": {}, "pulses": None,
                   "seconds": None, "rig_toml": ""}  # fmt: skip
        self.processes.tell({**command, **order})
        return path

    def finished(self, path: Path) -> Message:
        """Wait for the end of a recording; the recorder's report."""
        self.until(f"{path.name} is finished", lambda: (self.last("finished") or {}).get("path") == str(path))
        report = self.last("finished")
        assert report is not None
        return report

    def health(self) -> Message:
        """The last health report since the reports were cleared."""
        return self.last("health") or {"preroll": {"seconds": 0.0}, "pairing": {"pulses": 0}, "cameras": []}

    def held_s(self) -> float:
        """Seconds that the recorder holds."""
        return float(self.health()["preroll"]["seconds"])

    def connected(self) -> set[int]:
        """Cameras that were reported to be there since the reports were cleared."""
        return {r["camera"] for r in self.reports if r["report"] == "camera" and r["state"] == "connected"}

    def let_pass(self, pulses: int) -> None:
        """Wait for so many pulses."""
        until = self.health()["pairing"]["pulses"] + pulses
        self.until(f"{pulses} pulses pass", lambda: self.health()["pairing"]["pulses"] >= until)


@contextmanager
def _running(folder: Path, loopback: Loopback, *, preroll_s: float = 4.0) -> Iterator[Running]:
    rig, epoch = make_rig(folder, "sim", loopback), host_now()
    preview = PreviewSlot.create(rig.triplet_shape, len(rig.cameras))
    options = {"preroll_s": preroll_s, "directory": str(folder), "preview": preview.fd}
    with (
        simulated_hill(rig, epoch),
        RigProcesses(rig, lambda _: None, epoch=epoch, recorder=options, inherit=(preview.fd,)) as processes,
    ):
        running = Running(rig, processes, preview, folder)
        running.until("whole triplets come", lambda: processes.warm)
        yield running
    preview.close()


def _is_sound(path: Path) -> None:
    """Every pulse has its tag, and most of them their frames: a machine that is overloaded may lose some."""
    report = verify(path)
    assert report.verdict != "damaged", report.findings
    assert report.ledger.complete > report.pulses // 2


def test_the_last_three_seconds_are_saved_and_the_next_recording_goes_on(tmp_path: Path, loopback: Loopback) -> None:
    with _running(tmp_path, loopback) as running:
        running.let_pass(135)  # the past from before all cameras were there is forgotten
        assert running.held_s() == pytest.approx(4.0, abs=0.3)
        past = running.start("past", preroll_s=3.0, seconds=0)
        report = running.finished(past)
        started = running.last("started")
        assert started is not None
        running.until("1 s is held again", lambda: 1.0 < running.held_s() < 3.0)
        both = running.start("both", preroll_s=None, pulses=30, seconds=1)
        running.finished(both)
    assert 88 <= report["pulses"] <= 91
    assert report["bytes"] == past.stat().st_size
    for path in (past, both):
        _is_sound(path)
        hill = hill_pulses(path, running.rig)
        steps = {min(seen) - pulse for pulse, seen in hill.items() if seen}
        assert len(steps) == 1, "no pulse is left out, none comes twice"
        assert {tag.recording for tag, _ in triplets(path)} == {path.stem}
    tags = [tag for tag, _ in triplets(past)]
    assert started["first_pulse_ns"] == report["first_pulse_ns"] == tags[0].time
    assert verify(both).pulses > 30 + 25
    assert next(triplets(both))[0].time > tags[-1].time, "no pulse is in two recordings"


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
        pulses = running.finished(path)["pulses"]
        assert pulses > 100
        got: list[int] = []
        while len(got) < pulses and socket.poll(10_000):
            _, tag, image = socket.recv_multipart()
            got.append(json.loads(tag)["pulse"])
            assert len(image) == 480 * 1920
    assert got == list(range(1, pulses + 1))


def test_health_says_everything_and_keeps_its_schema(tmp_path: Path, loopback: Loopback) -> None:
    with _running(tmp_path, loopback) as running:
        running.let_pass(60)
        path = running.start("jump", preroll_s=None, pulses=45)
        running.finished(path)
        health = running.processes.health
    with LogReader(path) as reader:
        records = [json.loads(bytes(message.data or b"")) for message in reader.messages("/health")]
    assert len(records) >= 2, "that of the past and of the present"
    for record in records:
        jsonschema.validate(record, HEALTH_SCHEMA)
        _has_exactly(record, HEALTH_SCHEMA)
    assert health["disk"]["free_bytes"] == pytest.approx(os.statvfs(tmp_path).f_bavail * 4096, rel=0.2)
    assert health["preroll"]["limit_s"] == 4.0
    assert health["preroll"]["memory_mb"] == pytest.approx(120 * 0.93, rel=0.01)
    assert health["latency"]["count"] > 40
    for camera in health["cameras"]:
        assert abs(camera["clock_offset_us"]) < 1000
        assert camera["temperature_c"] is None or 0 < camera["temperature_c"] < 100


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
            "it has been recording for a while", lambda: (running.last("progress") or {}).get("pulses", 0) > 60
        )
        os.kill(running.processes.pids[RECORDER], signal.SIGKILL)
        with pytest.raises(ProcessDiedError, match="killed by SIGKILL"):
            running.until("its death is noticed", lambda: False)
        running.reports.clear()
        running.processes.restart_recorder()
        running.until("whole triplets come again", lambda: running.processes.warm)
        running.until("all cameras are known again", lambda: running.connected() == {0, 1, 2})
        after = running.start("after", preroll_s=0.0, pulses=60)
        running.finished(after)
        running.until(
            "slots that the dead one had in hand are free",
            lambda: running.health()["cameras"] and all(c["slots_queued"] <= 2 for c in running.health()["cameras"]),
        )
        assert running.processes.restarts == {"K1": 0, "K2": 0, "K3": 0}
        image = running.preview.read()
        assert image is not None
        assert image.pulse < 1000
    assert verify(after).pulses == 60
    _is_sound(after)
    left = verify(broken)
    assert not left.closed
    assert left.pulses > 50
    assert not left.ledger.missing
