"""Counts, in a process of its own, what a photogrammetry worker beside a recording would get, and how late.

`svev demo` and the benchmarks run it: `subscriber` starts and asks the process, `main` is what runs in it.
"""

import select
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

import zmq

from recorder.publishing.publisher import live_topic
from rig.errors import ProcessDiedError
from rig.tag import TripletTag
from rig.topics import HEALTH, TRIPLET
from rig.transport.child import begin
from rig.transport.message import Message, Quit
from rig.transport.process_table import ProcessSpec, ProcessTable

T = TypeVar("T")

_ANSWER_S: Final = 15.0
_GRACE_S: Final = 5.0
_SUBSCRIBED_MS: Final = 10_000
_WAKE_MS: Final = 200
_NAME: Final = "subscriber"
_TRIPLET, _HEALTH = live_topic(TRIPLET), live_topic(HEALTH)


class SubscriberConfig(Message):
    """What the process is told first.

    Attributes:
        address: where triplets are published.
        arrivals: whether to report the time of every message too.
    """

    address: str
    arrivals: bool


class SubscriberReady(Message):
    """The publisher knows of the subscriptions."""


class SubscriberCount(Message):
    """What came until the end.

    Attributes:
        received: number of triplets.
        missing: pulses that are missing between the first and the last.
        bytes: of images.
        latency_ms: median and p99, from the last frame in the host's memory to the message in this process.
        arrivals: for each complete triplet, time of its pulse and of the message, UTC, ns; empty unless asked for.
    """

    received: int
    missing: int
    bytes: int
    latency_ms: dict[str, float | None]
    arrivals: list[tuple[int, int]]


@contextmanager
def subscriber(address: str, *, arrivals: bool = False) -> Iterator[Callable[[], SubscriberCount]]:
    """Run the process; within the context it is subscribed.

    Args:
        address: where triplets are published.
        arrivals: whether to report the time of every message too.

    Yields:
        A function that ends the subscription and says what came until then.

    Raises:
        ProcessDiedError: the process does not answer in time; the function raises it too.
    """
    module, config = "recorder.publishing.subscriber", SubscriberConfig(address=address, arrivals=arrivals)
    table = ProcessTable()

    def count() -> SubscriberCount:
        table[_NAME].control.send(Quit())
        return _await_report(table, SubscriberCount)

    try:
        table.start(ProcessSpec(_NAME, module, config, reports=SubscriberReady | SubscriberCount))
        _await_report(table, SubscriberReady)
        yield count
    finally:
        table.stop()


def _await_report(table: ProcessTable, wanted: type[T]) -> T:
    deadline = time.monotonic() + _ANSWER_S
    while time.monotonic() < deadline:
        ended = table.dead()  # asked first: what it reported before its end is read below
        for _, report in table.receive(0.1):
            if isinstance(report, wanted):
                return report
        if ended:
            break
    raise ProcessDiedError("the subscriber process does not answer: start again")


def free_address() -> str:
    """A ZeroMQ address on loopback whose port is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


def median_and_p99(values: list[float]) -> dict[str, float | None]:
    """The median and the 99th percentile; None for both if there are no values."""
    ordered = sorted(values)

    def at(fraction: float) -> float | None:
        return round(ordered[min(len(ordered) - 1, int(fraction * len(ordered)))], 3) if ordered else None

    return {"median": at(0.5), "p99": at(0.99)}


class _Count:
    """What came so far: the pulse numbers in the order in which they came, latencies and arrivals of complete ones."""

    def __init__(self) -> None:
        self._pulses: list[int] = []
        self._latency_ms: list[float] = []
        self._arrivals: list[tuple[int, int]] = []
        self._bytes = 0

    def receive(self, subscription: "zmq.Socket[bytes]") -> None:
        """Count the message that waits; one on another topic, subscribed to at first, is dropped."""
        topic, *parts = subscription.recv_multipart(copy=False)
        if topic.bytes != _TRIPLET:
            return
        now_utc_ns = time.time_ns()
        tag, image = TripletTag.decode(parts[0].bytes), parts[1]
        self._pulses.append(tag.pulse)
        self._bytes += len(image)
        if tag.complete:
            last = max(camera.host_time for camera in tag.cameras if camera.host_time is not None)
            self._latency_ms.append((now_utc_ns - last) / 1e6)
            self._arrivals.append((int(tag.time), now_utc_ns))

    def report(self, *, arrivals: bool) -> SubscriberCount:
        """Totals, and what is missing between the first and the last pulse."""
        expected = self._pulses[-1] - self._pulses[0] + 1 if self._pulses else 0
        return SubscriberCount(
            received=len(self._pulses),
            missing=expected - len(set(self._pulses)),
            bytes=self._bytes,
            latency_ms=median_and_p99(self._latency_ms),
            arrivals=self._arrivals if arrivals else [],
        )


def _await_subscription(subscription: "zmq.Socket[bytes]") -> None:
    """Wait for the first health message: it proves that the publisher knows of our subscriptions."""
    if not subscription.poll(_SUBSCRIBED_MS):
        raise SystemExit("subscriber: nothing is published; is the address right?")
    subscription.recv_multipart()
    subscription.setsockopt(zmq.UNSUBSCRIBE, _HEALTH)


def main() -> None:
    """Count until told to quit, then what is left in the socket too; report."""
    child = begin(SubscriberConfig, Quit, _GRACE_S)
    count = _Count()
    with zmq.Context() as context, context.socket(zmq.SUB) as subscription:
        subscription.setsockopt(zmq.RCVHWM, 64)
        subscription.setsockopt(zmq.SUBSCRIBE, _TRIPLET)
        subscription.setsockopt(zmq.SUBSCRIBE, _HEALTH)
        subscription.connect(child.config.address)
        _await_subscription(subscription)
        child.control.send(SubscriberReady())
        poller = zmq.Poller()
        poller.register(subscription, zmq.POLLIN)
        poller.register(child.control.fileno(), select.POLLIN)
        while not child.stopping():
            if dict(poller.poll(_WAKE_MS)).get(subscription):
                count.receive(subscription)
        while subscription.poll(_WAKE_MS):
            count.receive(subscription)
    child.control.send(count.report(arrivals=child.config.arrivals))


if __name__ == "__main__":
    main()
