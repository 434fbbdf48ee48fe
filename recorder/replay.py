"""Publishes a log over ZeroMQ exactly as it was published live, or serves it so that nothing is lost."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from recorder.events import Event
from recorder.log_items import Chunk, Damage, Message
from recorder.log_reader import LogReader
from recorder.raw_image import view_image
from recorder.replay_sinks import PublishSink, PushSink, Sink
from recorder.zmq_address import live_topic
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.topics import DEFAULT_PUBLISH, EVENTS, HEALTH, TAG, TRIPLET

_TRIPLET, _EVENT, _HEALTH = live_topic(TRIPLET), live_topic(EVENTS), live_topic(HEALTH)


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """How a log is replayed.

    Attributes:
        address: where to bind.
        speed: 1 is as it was, 2 twice as fast; None: as fast as possible.
        reliable: serve over PUSH: every message reaches a worker, however slow it is.
        loop: begin again at the end, until stopped.
        first, last: pulses to begin and to end with; None: all.
        wait_s: wait at most so long for the first subscriber or worker.
    """

    address: str = DEFAULT_PUBLISH
    speed: float | None = 1.0
    reliable: bool = False
    loop: bool = False
    first: int | None = None
    last: int | None = None
    wait_s: float = 10.0


@dataclass(slots=True)
class ReplayReport:
    """What was sent.

    Attributes:
        triplets: pulses sent.
        messages: all messages sent, those of pulses included.
        bytes: bytes of the images sent.
        rounds: how many times the log was begun.
        seconds: from the first message to the last.
        attended: somebody was there before the first message.
        interrupted: it was stopped before the end.
        closed: the log was closed properly.
        truncated: it ends in the middle of a record.
        damaged_bytes: bytes of the log that could not be read, and so were not sent.
    """

    log: str
    address: str
    triplets: int = 0
    messages: int = 0
    bytes: int = 0
    rounds: int = 0
    seconds: float = 0.0
    attended: bool = False
    interrupted: bool = False
    closed: bool = True
    truncated: bool = False
    damaged_bytes: int = 0

    def to_json(self) -> dict[str, Any]:
        """The report as one JSON object."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Outgoing:
    """One message; `image` is None where there is no third part, and valid until the next one is taken."""

    time: UtcNs
    topic: bytes
    content: bytes
    image: memoryview | None = None


def replay(
    path: Path,
    options: ReplayOptions,
    *,
    stop: threading.Event | None = None,
    ready: Callable[[str], None] | None = None,
    progress: Callable[[int], None] | None = None,
) -> ReplayReport:
    """Send a log's triplets, events and health at their own pace.

    Args:
        path: the log; one that is damaged is sent as far as it can be read.
        options: how.
        stop: set from elsewhere to end early; an interrupt from the keyboard does the same.
        ready: told the address, once it is bound.
        progress: told how many triplets have been sent.

    Raises:
        BadInputError: no such log, address in use, no such pulses, or (`reliable`) no worker came.
    """
    stop = stop or threading.Event()
    with LogReader(path) as reader:
        sink: Sink = PushSink(options.address) if options.reliable else PublishSink(options.address)
        report = ReplayReport(str(path), sink.address, closed=reader.closed)
        try:
            if ready is not None:
                ready(sink.address)
            report.attended = sink.wait(options.wait_s, stop)
            if options.reliable and not report.attended and not stop.is_set():
                waited = f"{options.wait_s:g} s"
                raise BadInputError(f"{sink.address}: no worker connected within {waited}; start one, or wait longer")
            _Replay(reader, sink, options, report, stop, progress or (lambda _: None)).run()
            report.interrupted = stop.is_set()
            sink.finish(stop)
        except KeyboardInterrupt:
            report.interrupted = True
            stop.set()
        finally:
            sink.close()
    return report


class _Replay:
    """The state of one replay."""

    def __init__(
        self,
        reader: LogReader,
        sink: Sink,
        options: ReplayOptions,
        report: ReplayReport,
        stop: threading.Event,
        progress: Callable[[int], None],
    ) -> None:
        self._reader, self._sink, self._options = reader, sink, options
        self._report, self._stop, self._progress = report, stop, progress
        self._damaged = 0
        self._highest = 0

    def run(self) -> None:
        begin = time.monotonic()
        while not self._stop.is_set():
            self._report.rounds += 1
            self._round()
            self._report.seconds = round(time.monotonic() - begin, 6)
            if not self._report.triplets and not self._stop.is_set():
                asked = f"{self._options.first or 1} to {self._options.last or 'the last'}"
                raise BadInputError(
                    f"{self._reader.path}: has no pulses from {asked}; it has {self._highest}, choose among them"
                )
            if not self._options.loop:
                return

    def _round(self) -> None:
        """Send the log once."""
        begin = time.monotonic()
        first: UtcNs | None = None
        self._damaged = 0
        for message in self._messages():
            first = message.time if first is None else first
            if self._options.speed is not None:
                due = begin + (message.time - first) / NS_PER_S / self._options.speed
                self._stop.wait(max(0.0, due - time.monotonic()))
            parts = [message.topic, message.content] + ([] if message.image is None else [message.image])
            if self._stop.is_set() or not self._sink.send(parts, self._stop):
                break
            self._report.messages += 1
            if message.image is not None:
                self._report.triplets += 1
                self._report.bytes += len(message.image)
                self._progress(self._report.triplets)
        self._report.damaged_bytes, self._report.truncated = self._damaged, self._reader.truncated

    def _messages(self) -> Iterator[_Outgoing]:
        """What was published live, from the first pulse that is asked for to the last."""
        begun = self._options.first is None
        for item in self._reader.items():
            if isinstance(item, Damage) or (isinstance(item, Chunk) and item.flaw):
                self._damaged += item.length
            elif isinstance(item, Chunk):
                pulse = max((m.sequence for m in item.messages if m.topic == TAG.name), default=None)
                if pulse is not None:
                    self._highest = max(self._highest, pulse)
                    begun = begun or pulse >= (self._options.first or 1)
                    if self._options.last is not None and pulse > self._options.last:
                        return
                if begun:
                    yield from _published(item)


def _published(chunk: Chunk) -> Iterator[_Outgoing]:
    """The messages of a chunk in the form in which they are published. A tag stands before its image."""
    images = {m.sequence: m for m in chunk.messages if m.topic == TRIPLET.name}
    for message in chunk.messages:
        data = message.data or memoryview(b"")
        match message.topic:
            case TAG.name:
                yield _Outgoing(message.log_time, _TRIPLET, bytes(data), _pixels(images.get(message.sequence)))
            case EVENTS.name:
                event = json.dumps(Event.from_protobuf(data).to_json(), separators=(",", ":"))
                yield _Outgoing(message.log_time, _EVENT, event.encode())
            case HEALTH.name:
                yield _Outgoing(message.log_time, _HEALTH, bytes(data))


def _pixels(image: Message | None) -> memoryview:
    """The pixels of an image message in place; none for a pulse without an image."""
    return memoryview(b"") if image is None else view_image(image.data or memoryview(b"")).pixels
