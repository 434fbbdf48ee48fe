"""Replay over real sockets: the same messages as live, at the log's own pace, and without loss where that is asked."""

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zmq

from recorder.publishing.replay import ReplayOptions, ReplayReport, replay
from rig.errors import BadInputError
from rig.transport import wire
from tests.recorder.hostile.builder import Builder, event, image
from tests.recorder.logs import ALL_OK, LOST, OK, OWN_TOPICS, PERIOD_NS, Written, write_log
from tests.support.loopback import Loopback

PULSES = (ALL_OK, (OK, LOST, OK), (LOST,) * 3, ALL_OK, ALL_OK)


class Listener:
    """A SUB or PULL socket in a thread of its own that keeps what it gets.

    Attributes:
        messages: everything received.
    """

    def __init__(self, kind: int, pause_s: float = 0.0, stop_at: int | None = None) -> None:
        self.messages: list[list[bytes]] = []
        self._kind, self._pause_s, self._stop_at = kind, pause_s, stop_at
        self._end = threading.Event()
        self._thread: threading.Thread | None = None

    def connect(self, address: str) -> None:
        """Begin to listen."""
        self._thread = threading.Thread(target=self._listen, args=(address,))
        self._thread.start()

    def join(self) -> list[list[bytes]]:
        """Wait until nothing more comes."""
        assert self._thread is not None
        self._end.set()
        self._thread.join(30)
        return self.messages

    def _listen(self, address: str) -> None:
        with zmq.Context() as context, context.socket(self._kind) as receiver:
            receiver.linger = 0
            receiver.rcvhwm = 1 if self._pause_s else 1000
            if self._kind == zmq.SUB:
                receiver.subscribe(b"")
            receiver.connect(address)
            while receiver.poll(300) or not self._end.is_set():
                if receiver.poll(0):
                    self.messages.append(receiver.recv_multipart())
                    self._end.wait(self._pause_s)


@contextmanager
def _listening(kind: int = zmq.SUB, pause_s: float = 0.0) -> Iterator[Listener]:
    listener = Listener(kind, pause_s)
    try:
        yield listener
    finally:
        if listener._thread is not None:
            listener.join()


def _replayed(path: Path, listener: Listener, options: ReplayOptions) -> tuple[ReplayReport, list[list[bytes]]]:
    report = replay(path, options, ready=listener.connect)
    return report, listener.join()


def _check(messages: list[list[bytes]], written: list[Written]) -> None:
    triplets = [message for message in messages if message[0] == b"triplet"]
    assert [json.loads(tag) for _, tag, _ in triplets] == [wire.to_builtins(w.tag) for w in written]
    for (_, _, pixels), w in zip(triplets, written, strict=True):
        assert pixels == (b"" if w.image is None else w.image.tobytes())


@pytest.mark.parametrize("cameras", [(), OWN_TOPICS], ids=["triplets", "cameras"])
@pytest.mark.parametrize(("kind", "reliable"), [(zmq.SUB, False), (zmq.PULL, True)])
def test_all_messages_are_those_of_live_operation(
    tmp_path: Path, loopback: Loopback, kind: int, *, reliable: bool, cameras: tuple[tuple[str, tuple[int, int]], ...]
) -> None:
    written = write_log(tmp_path / "log.mcap", PULSES, cameras=cameras)
    with _listening(kind) as listener:
        report, messages = _replayed(
            tmp_path / "log.mcap", listener, ReplayOptions(loopback.endpoint(), speed=None, reliable=reliable)
        )
    _check(messages, written)
    assert [message[0] for message in messages] == [b"event", *[b"triplet"] * 5, b"health", b"event"]
    start = json.loads(messages[0][1])
    assert (start["level"], start["name"], start["message"]) == ("info", "recorder", "recording started")
    assert json.loads(messages[-2][1]) == {"free_triplets": 4}
    assert (report.triplets, report.messages, report.rounds, report.attended) == (5, 8, 1, True)
    assert report.bytes == sum(w.image.size for w in written if w.image is not None)


@pytest.mark.parametrize(
    "odd",
    [
        Builder().event(event() + b"\x10\x63"),
        Builder().health(b"[" * 30_000 + b"]" * 30_000),
        Builder().tag_with(shape=[0, 0]),
        Builder().picture(image(2, data=b"")),
    ],
    ids=["event of level 99", "nested health record", "shape of zero", "image without pixels"],
)
def test_what_cannot_be_read_is_left_out_and_counted(tmp_path: Path, loopback: Loopback, odd: Builder) -> None:
    odd.write(tmp_path / "log.mcap")
    with _listening(zmq.PULL) as listener:
        report, messages = _replayed(
            tmp_path / "log.mcap", listener, ReplayOptions(loopback.endpoint(), speed=None, reliable=True)
        )
    assert [message[0] for message in messages] == [b"triplet", b"triplet"]
    assert (report.triplets, report.damaged_bytes > 0) == (2, True)


def test_a_slow_worker_loses_nothing(tmp_path: Path, loopback: Loopback) -> None:
    written = write_log(tmp_path / "log.mcap", (ALL_OK,) * 60, (240, 960))  # 14 MB: more than any buffer on the way
    with _listening(zmq.PULL, pause_s=0.01) as listener:
        replay(
            tmp_path / "log.mcap", ReplayOptions(loopback.endpoint(), speed=None, reliable=True), ready=listener.connect
        )
        # Everything has left us now; the worker's pace must not matter any more.
        _check(listener.join(), written)


def test_workers_share_the_triplets(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 40, (240, 960))
    with _listening(zmq.PULL) as first, _listening(zmq.PULL) as second:

        def connect(address: str) -> None:
            first.connect(address)
            second.connect(address)

        replay(tmp_path / "log.mcap", ReplayOptions(loopback.endpoint(), speed=None, reliable=True), ready=connect)
        pulses = [
            json.loads(message[1])["pulse"] for message in first.join() + second.join() if message[0] == b"triplet"
        ]
    assert sorted(pulses) == list(range(1, 41))


def test_no_worker_in_time_is_an_error(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap")
    with pytest.raises(BadInputError, match=r"no worker connected within 0.05 s; start one"):
        replay(tmp_path / "log.mcap", ReplayOptions(loopback.endpoint(), reliable=True, wait_s=0.05))


def test_without_a_subscriber_it_is_published_all_the_same(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap")
    report = replay(tmp_path / "log.mcap", ReplayOptions(loopback.endpoint(), speed=None, wait_s=0.0))
    assert (report.triplets, report.attended) == (4, False)


@pytest.mark.parametrize(("speed", "share"), [(1.0, 1.0), (4.0, 0.25)])
def test_the_pace_is_that_of_the_log(tmp_path: Path, loopback: Loopback, speed: float, share: float) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK,) * 13)
    begin = time.monotonic()
    options = ReplayOptions(loopback.endpoint(), speed=speed, first=1, last=12, wait_s=0.0)
    report = replay(path, options)
    # Only a lower bound can be sure: never sooner than it was.
    assert time.monotonic() - begin >= 11 * PERIOD_NS / 1e9 * share
    assert report.triplets == 12


@pytest.mark.parametrize(
    ("first", "last", "expected"), [(None, 2, [1, 2]), (4, None, [4, 5]), (2, 4, [2, 3, 4]), (5, 5, [5])]
)
def test_from_and_to_choose_pulses(
    tmp_path: Path, loopback: Loopback, first: int | None, last: int | None, expected: list[int]
) -> None:
    write_log(tmp_path / "log.mcap", PULSES)
    options = ReplayOptions(loopback.endpoint(), speed=None, reliable=True, first=first, last=last)
    with _listening(zmq.PULL) as listener:
        _, messages = _replayed(tmp_path / "log.mcap", listener, options)
    assert [json.loads(m[1])["pulse"] for m in messages if m[0] == b"triplet"] == expected


def test_pulses_that_are_not_there_are_an_error(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap")
    with pytest.raises(BadInputError, match="has no pulses from 9 to the last; it has 4"):
        replay(tmp_path / "log.mcap", ReplayOptions(loopback.endpoint(), speed=None, first=9, wait_s=0.0, loop=True))


@pytest.mark.parametrize("reliable", [False, True])
def test_a_loop_goes_on_until_it_is_stopped(tmp_path: Path, loopback: Loopback, *, reliable: bool) -> None:
    write_log(tmp_path / "log.mcap")
    stop = threading.Event()

    def stop_in_third_round(sent: int) -> None:
        if sent == 10:
            stop.set()

    with _listening(zmq.PULL if reliable else zmq.SUB) as listener:
        options = ReplayOptions(loopback.endpoint(), speed=None, reliable=reliable, loop=True)
        report = replay(tmp_path / "log.mcap", options, stop=stop, ready=listener.connect, progress=stop_in_third_round)
    assert (report.triplets, report.rounds, report.interrupted) == (10, 3, True)


def test_a_stop_ends_the_wait_for_a_worker_and_for_the_next_pulse(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap")
    stop = threading.Event()
    stop.set()
    for reliable in (False, True):
        options = ReplayOptions(loopback.endpoint(), speed=0.1, reliable=reliable, wait_s=60)
        report = replay(tmp_path / "log.mcap", options, stop=stop)
        assert (report.triplets, report.interrupted) == (0, True)


def test_a_damaged_log_is_sent_as_far_as_it_can_be_read(tmp_path: Path, loopback: Loopback) -> None:
    path = tmp_path / "log.mcap"
    written = write_log(path, (ALL_OK,) * 6, (64, 192))
    data = path.read_bytes()
    image = written[2].image
    assert image is not None
    spoilt = data.find(image.tobytes())
    path.write_bytes(data[:spoilt] + bytes([data[spoilt] ^ 1]) + data[spoilt + 1 : -100])
    with _listening(zmq.PULL) as listener:
        report, messages = _replayed(path, listener, ReplayOptions(loopback.endpoint(), speed=None, reliable=True))
    _check(messages, written[:2] + written[3:])
    assert report.damaged_bytes > image.size
    assert not report.closed


def test_an_address_in_use_is_named(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap")
    with zmq.Context() as context, context.socket(zmq.PUB) as other:
        other.bind(f"tcp://{loopback.host}:*")
        address = other.get_string(zmq.LAST_ENDPOINT)
        for reliable in (False, True):
            with pytest.raises(BadInputError, match="address in use"):
                replay(tmp_path / "log.mcap", ReplayOptions(address, reliable=reliable))
