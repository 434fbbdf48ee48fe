"""Subscribers that mean harm, real processes: memory stays, no pulse is lost, others get every triplet."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path

import pytest
import zmq

from recorder.checking.verify import verify
from recorder.publishing.peers import MOST_PEERS
from recorder.publishing.publisher import Publisher
from recorder.reading.log_reader import LogReader
from rig.clocks import host_now
from rig.events import Event, Level
from rig.phrase import plain
from rig.transport.recorder_commands import RecorderOptions, StartRecording, StopRecording
from rig.transport.recorder_reports import RecordingFinished
from service.processes.rig_processes import RigProcesses
from service.processes.rig_programs import RECORDER
from tests.capture.rigs import make_rig
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.waiting import wait_until

WAIT_S = 60.0
MB = 1e6
#: What each of them asks for; without limits: 1.2 GB, 120 MB, and more than there is.
ATTACKS = {"long": 10_000_000, "many": 1_000_000, "flood": 0, "chatter": 0, "crowd": 1000}


@contextmanager
def _hostile(kind: str, address: str) -> Iterator[None]:
    """The hostile program has begun what it does, and goes on."""
    command = [sys.executable, "-m", "tests.recorder.publishing.hostile_subscriber"]
    with subprocess.Popen(
        [*command, kind, address, str(ATTACKS[kind])], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "done\n"
            yield
        finally:
            process.kill()


def _memory(pid: int | str = "self") -> float:
    """Memory of a process now, bytes."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024.0 for line in lines if line.startswith("VmRSS"))


def _open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


@pytest.mark.parametrize("kind", ATTACKS)
def test_whoever_asks_too_much_is_hung_up_on_and_counted(kind: str, loopback: Loopback) -> None:
    reasons = {"long": "sent a long message", "crowd": f"came when {MOST_PEERS} were connected"}
    expected = reasons.get(kind, "sent too much")
    with closing(Publisher(loopback.endpoint())) as publisher:
        refused: dict[str, int] = {}

        def is_refused() -> bool:
            for _ in range(10):
                publisher.event(Event.now(Level.INFO, "test", plain("hello")))
            refused.update(publisher.refused())
            return any(why.startswith(expected) for why in refused)

        before = _memory()
        with _hostile(kind, publisher.address):
            wait_until(is_refused, f"it is refused because it {expected}: {refused}", WAIT_S)
            wait_until(lambda: _open_files() < 3 * MOST_PEERS, "connections are closed", WAIT_S)
        assert _memory() - before < 60 * MB


def test_a_slow_flood_of_topics_is_refused_as_well(loopback: Loopback) -> None:
    """Each subscriber sends few topics, but all together more than anybody needs."""
    with closing(Publisher(loopback.endpoint())) as publisher, zmq.Context() as context, ExitStack() as stack:
        for number in range(5):
            sub = stack.enter_context(context.socket(zmq.SUB))
            sub.linger = 0
            sub.connect(publisher.address)
            for topic in range(100):
                sub.subscribe(b"%d %d" % (number, topic) + b"x" * 200)

        def too_many() -> bool:
            publisher.event(Event.now(Level.INFO, "test", plain("hello")))
            return "subscribed to too many topics" in publisher.refused()

        wait_until(too_many, "one of them is refused", WAIT_S)


def _is_served(publisher: Publisher, subscriber: "zmq.Socket[bytes]") -> bool:
    """Whether something that was published has come; who leaves before that may look as if he spoke no ZeroMQ."""
    publisher.event(Event.now(Level.INFO, "test", plain("hello")))
    return bool(subscriber.poll(0))


def test_many_ordinary_subscribers_are_welcome_again_and_again(loopback: Loopback) -> None:
    with closing(Publisher(loopback.endpoint())) as publisher:
        for _ in range(5):
            with ExitStack() as stack:
                context = stack.enter_context(zmq.Context())
                waiting = [stack.enter_context(context.socket(zmq.SUB)) for _ in range(20)]
                for sub in waiting:
                    sub.subscribe(b"")
                    sub.connect(publisher.address)
                for sub in waiting:
                    wait_until(partial(_is_served, publisher, sub), "it is there", WAIT_S)
            wait_until(lambda: not publisher.wait_for_subscriber(0.0), "all are gone", WAIT_S)
        assert publisher.refused() == {}


@pytest.mark.long
def test_a_recording_loses_nothing_to_hostile_subscribers(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    rig, path = make_rig(tmp_path, "sim", loopback), tmp_path / "attacked.mcap"
    with (
        RigProcesses(rig, lambda _: None, epoch=host_now(), recorder=RecorderOptions(directory=tmp_path)) as processes,
        zmq.Context() as context,
        context.socket(zmq.SUB) as good,
    ):
        good.rcvhwm = 10_000
        good.subscribe(b"triplet")
        good.connect(rig.network.publish)
        reports: list[object] = []

        def turned(*kinds: type) -> bool:
            reports.extend(processes.turn(0.05))
            return any(isinstance(report, kinds) for report in reports)

        wait_until(lambda: turned() or processes.seen.warm, "whole triplets come", WAIT_S, 0.0)
        recorder = processes.pids[RECORDER]
        processes.tell(StartRecording(path=path, session={}, preroll_s=0.0))
        wait_until(lambda: path.exists() and path.stat().st_size > 10 * MB, "it records", WAIT_S)
        before = _memory(recorder)
        for kind in ATTACKS:
            with _hostile(kind, rig.network.publish):
                size = path.stat().st_size
                wait_until(lambda size=size: path.stat().st_size > size + 40 * MB, "recording goes on", WAIT_S)  # type: ignore[misc]
        assert _memory(recorder) - before < 60 * MB
        processes.tell(StopRecording())
        wait_until(lambda: turned(RecordingFinished), "the recording is over", WAIT_S, 0.0)
        got = []
        while good.poll(2000):
            got.append(json.loads(good.recv_multipart()[1])["pulse"])
    report = verify(path)
    assert not report.damaged
    assert report.ledger.pulses > 200
    # A machine that is overloaded may lose some: five programs pour in all that they can.
    assert report.ledger.complete > 0.9 * report.ledger.pulses
    assert len(got) > 0.9 * report.ledger.pulses
    assert got == sorted(set(got))
    with LogReader(path) as reader:
        events = [Event.from_protobuf(message.data or b"") for message in reader.messages("/events")]
    said = [event.message for event in events if event.name == "publisher"]
    closed = [text for text in said if "connections are closed, of a program that sent too much" in text]
    assert closed, said
    what = "subscribers that send megabytes, or subscribe to thousands of topics"
    fault_table.tell("Network and other programs", what, lost=0, said=f"{closed[0]} (event)")
