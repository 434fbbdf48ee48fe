"""Publishes a log over ZeroMQ exactly as it was published live, or serves it so that no message is lost."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import zmq

from recorder.publishing.keys import Keys
from recorder.publishing.publisher import Publisher, bind, live_topic
from recorder.reading.items import Chunk, Message
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import RecordingReader
from recorder.reading.records import Damage
from recorder.reading.triplets import event_of, images_of, is_json, pixels, tag_of, view_image
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.topics import DEFAULT_PUBLISH, EVENTS, HEALTH, JUMPER, TAG, TRIPLET
from rig.transport import wire

_TRIPLET, _EVENT, _HEALTH, _JUMPER = (live_topic(topic) for topic in (TRIPLET, EVENTS, HEALTH, JUMPER))
_Parts = list[bytes | memoryview]
_POLL_S = 0.1
_LINGER_S = 5.0
#: No message is waited for longer, whatever time it has.
_WAIT_MAX_S = 3600.0
#: Replayed images are copied, so a subscriber's queue costs memory, not slots.
_QUEUE = 64


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """How a log is replayed.

    Attributes:
        address: ZeroMQ address to bind.
        speed: 1 is as it was, 2 twice as fast; None: as fast as possible.
        reliable: serve over PUSH: every message reaches a worker, however slow it is.
        loop: begin again at the end, until stopped.
        first, last: pulses to begin and to end with; None: all.
        wait_s: wait at most so long for the first subscriber or worker, s.
        keys: serve only those who have the public key; None: everybody.
    """

    address: str = DEFAULT_PUBLISH
    speed: float | None = 1.0
    reliable: bool = False
    loop: bool = False
    first: int | None = None
    last: int | None = None
    wait_s: float = 10.0
    keys: Keys | None = None


@dataclass(slots=True)
class ReplayReport:
    """What was sent.

    Attributes:
        log: path of the log.
        address: where the socket was bound.
        triplets: pulses sent.
        messages: all messages sent, those of pulses included.
        bytes: bytes of the images sent.
        rounds: how many times the log was begun.
        seconds: from the first message to the last, s.
        attended: a subscriber or worker had connected before the first message.
        interrupted: the replay was stopped before the end.
        closed: the log was closed properly.
        truncated: the log ends in the middle of a record.
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

    def to_json(self) -> dict[str, object]:
        """The report as one JSON object."""
        return asdict(self)


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
        stop: set from another thread to end early; an interrupt from the keyboard does the same.
        ready: called with the address, once it is bound.
        progress: called with the number of triplets sent so far.

    Raises:
        BadInputError: no such log, address in use, no such pulses, or (`reliable`) no worker came.
    """
    stop = stop or threading.Event()
    with RecordingReader(path) as reader:
        sink = (
            _PushSink(options.address, options.keys)
            if options.reliable
            else _PublishSink(options.address, options.keys)
        )
        report = ReplayReport(str(path), sink.address, closed=reader.closed)
        try:
            if ready is not None:
                ready(sink.address)
            report.attended = _wait_for_listener(sink, options.wait_s, stop)
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


class _PublishSink:
    """Publishes as in live operation: never waits, so a subscriber that is too slow misses messages.

    Attributes:
        address: where the socket is bound.
    """

    def __init__(self, address: str, keys: Keys | None) -> None:
        self._publisher = Publisher(address, queue=_QUEUE, keys=keys)
        self.address = self._publisher.address

    def has_listener(self, timeout_s: float) -> bool:
        """Wait for the first subscriber to triplets; False if none has subscribed within `timeout_s`."""
        return self._publisher.wait_for_subscriber(timeout_s)

    def send(self, parts: _Parts, stop: threading.Event) -> bool:
        """Publish a message; False if `stop` is set."""
        self._publisher.parts(parts)
        return not stop.is_set()

    def finish(self, stop: threading.Event) -> None:
        """Give subscribers a few seconds to take the rest."""
        self._publisher.close(0.0 if stop.is_set() else _LINGER_S)

    def close(self) -> None:
        """Unbind; a second call does nothing."""
        self._publisher.close()


class _PushSink:
    """Deals messages out to workers (PULL sockets) and waits for them, however slow they are.

    The few messages that are on the way to a worker when it dies are lost.

    Attributes:
        address: where the socket is bound.
    """

    def __init__(self, address: str, keys: Keys | None) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.PUSH)
        if keys is not None:
            keys.guard(self._socket)
        self._socket.sndhwm = 1
        self._socket.linger = 0
        try:
            self.address = bind(self._socket, address)
        except BaseException:
            self.close()
            raise

    def has_listener(self, timeout_s: float) -> bool:
        """Wait until a worker has room for a message; False if none has within `timeout_s`."""
        return bool(self._socket.poll(round(timeout_s * 1000), zmq.POLLOUT))

    def send(self, parts: _Parts, stop: threading.Event) -> bool:
        """Wait until a worker has room, then send; False if `stop` is set before."""
        while not stop.is_set():
            if self.has_listener(_POLL_S):
                self._socket.send_multipart(parts, zmq.DONTWAIT)
                return True
        return False

    def finish(self, stop: threading.Event) -> None:
        """Wait until the workers have taken everything, or `stop` is set."""
        if stop.is_set():
            return
        self._socket.close(linger=-1)
        # ZeroMQ ends its context only when all is delivered, and cannot be asked how far it is.
        ending = threading.Thread(target=self._context.term, name="replay delivers", daemon=True)
        ending.start()
        while ending.is_alive() and not stop.is_set():
            ending.join(_POLL_S)

    def close(self) -> None:
        """Unbind and drop what no worker has taken; a second call does nothing."""
        if not self._socket.closed:
            self._context.destroy(linger=0)


_Sink = _PublishSink | _PushSink


def _wait_for_listener(sink: _Sink, timeout_s: float, stop: threading.Event) -> bool:
    """Wait for the first subscriber or worker; False if none came within `timeout_s` or before `stop`."""
    deadline = time.monotonic() + timeout_s
    while not stop.is_set() and time.monotonic() < deadline:
        if sink.has_listener(_POLL_S):
            return True
    return False


@dataclass(slots=True)
class _Replay:
    """One replay, from which `report` is filled in."""

    reader: LogReader
    sink: _Sink
    options: ReplayOptions
    report: ReplayReport
    stop: threading.Event
    progress: Callable[[int], None]
    damaged_bytes: int = 0
    highest_pulse: int = 0

    def run(self) -> None:
        """Send the log once, or with `loop` until stopped.

        Raises:
            BadInputError: the log has none of the pulses that were asked for.
        """
        begin = time.monotonic()
        while not self.stop.is_set():
            self.report.rounds += 1
            self._round()
            self.report.seconds = round(time.monotonic() - begin, 6)
            if not self.report.triplets and not self.stop.is_set():
                asked = f"{self.options.first or 1} to {self.options.last or 'the last'}"
                raise BadInputError(
                    f"{self.reader.path}: has no pulses from {asked}; it has {self.highest_pulse}, choose among them"
                )
            if not self.options.loop:
                return

    def _round(self) -> None:
        """Send the log once."""
        begin = time.monotonic()
        first: UtcNs | None = None
        self.damaged_bytes = 0
        for log_time, parts in self._messages():
            first = log_time if first is None else first
            if self.options.speed is not None:
                due = begin + (log_time - first) / NS_PER_S / self.options.speed
                self.stop.wait(min(max(0.0, due - time.monotonic()), _WAIT_MAX_S))
            if self.stop.is_set() or not self.sink.send(parts, self.stop):
                break
            self.report.messages += 1
            if parts[0] == _TRIPLET:
                self.report.triplets += 1
                self.report.bytes += len(parts[2])
                self.progress(self.report.triplets)
        self.report.damaged_bytes, self.report.truncated = self.damaged_bytes, self.reader.truncated

    def _messages(self) -> Iterator[tuple[UtcNs, _Parts]]:
        """Log time and parts of what was published live, from the first pulse that was asked for to the last."""
        begun = self.options.first is None
        for item in self.reader.items():
            if isinstance(item, Damage) or (isinstance(item, Chunk) and item.flaw):
                self.damaged_bytes += item.length
            elif isinstance(item, Chunk):
                pulse = max((m.sequence for m in item.messages if m.topic == TAG.name), default=None)
                if pulse is not None:
                    self.highest_pulse = max(self.highest_pulse, pulse)
                    begun = begun or pulse >= (self.options.first or 1)
                    if self.options.last is not None and pulse > self.options.last:
                        return
                if begun:
                    yield from self._published(item)

    def _published(self, chunk: Chunk) -> Iterator[tuple[UtcNs, _Parts]]:
        """Log time and parts of a chunk's messages as they are published; pixels are valid until the next one is taken.

        What cannot be read is left out and counted.
        """
        images = images_of(chunk)
        for message in chunk.messages:
            if message.topic == TRIPLET.name:
                continue
            parts = _parts(message, images)
            if parts is not None:
                yield message.log_time, parts
            elif message.topic in (TAG.name, EVENTS.name, HEALTH.name, JUMPER.name):
                self.damaged_bytes += message.length


def _parts(message: Message, images: Mapping[int, Message]) -> _Parts | None:
    """A message as it is published, None if it is not or cannot be read."""
    data = message.data or memoryview(b"")
    match message.topic:
        case TAG.name:
            try:
                return [_TRIPLET, bytes(data), _pixels(images.get(message.sequence))] if tag_of(message) else None
            except ValueError:
                return None
        case EVENTS.name:
            event = event_of(message)
            return None if event is None else [_EVENT, wire.encode(event)]
        case HEALTH.name:
            return [_HEALTH, bytes(data)] if is_json(data) else None
        case JUMPER.name:
            return [_JUMPER, bytes(data)] if is_json(data) else None
    return None


def _pixels(image: Message | None) -> memoryview:
    """The pixels of an image message in place; none for a pulse without an image.

    Raises:
        ValueError: the message is no image, or not one of ours.
    """
    if image is None:
        return memoryview(b"")
    found = view_image(image.data or memoryview(b""))
    pixels(found)
    return found.pixels
