"""Child process: a subscriber that counts what it gets and how late, as a photogrammetry worker would see it."""

import json
import select
import time
from typing import Any, Final

import zmq

from rig.topics import HEALTH, TRIPLET
from svev.child import begin

_WAKE_MS: Final = 200
_SUBSCRIBED_MS: Final = 10_000
_TRIPLET: Final = (TRIPLET.live or "").encode()
_HEALTH: Final = (HEALTH.live or "").encode()
_GRACE_S: Final = 5.0


class Count:
    """What came so far.

    Attributes:
        pulses: pulse numbers in the order in which they came.
        latency_ms: for each complete triplet, from the last of its frames in the host's memory to the message here.
        arrivals: for each complete triplet, time of its pulse and of the message here, UTC, ns.
    """

    def __init__(self) -> None:
        self.pulses: list[int] = []
        self.latency_ms: list[float] = []
        self.arrivals: list[tuple[int, int]] = []
        self.bytes = 0

    def receive(self, socket: "zmq.Socket[bytes]") -> None:
        """Count the message that is there; what else was subscribed to at first is passed over."""
        topic, *parts = socket.recv_multipart(copy=False)
        if topic.bytes == _TRIPLET:
            tag, image = parts
            self.take(tag.bytes, len(image), time.time_ns())

    def take(self, tag_json: bytes, size: int, now_utc_ns: int) -> None:
        """One message."""
        tag = json.loads(tag_json)
        self.pulses.append(tag["pulse"])
        self.bytes += size
        if tag["complete"]:
            last = max(int(camera["host_time_ns"]) for camera in tag["cameras"])
            self.latency_ms.append((now_utc_ns - last) / 1e6)
            self.arrivals.append((int(tag["time_ns"]), now_utc_ns))

    def to_json(self) -> dict[str, Any]:
        """Totals, and what is missing between the first and the last pulse."""
        expected = self.pulses[-1] - self.pulses[0] + 1 if self.pulses else 0
        return {
            "received": len(self.pulses),
            "missing": expected - len(set(self.pulses)),
            "bytes": self.bytes,
            "latency_ms": median_and_p99(self.latency_ms),
        }


def median_and_p99(values: list[float]) -> dict[str, float | None]:
    """The middle and the 99th percentile; None of nothing."""
    ordered = sorted(values)

    def at(fraction: float) -> float | None:
        return round(ordered[min(len(ordered) - 1, int(fraction * len(ordered)))], 3) if ordered else None

    return {"median": at(0.5), "p99": at(0.99)}


def _await_subscription(socket: "zmq.Socket[bytes]") -> None:
    """Wait for the first health message: it proves that the publisher knows of our subscriptions."""
    if not socket.poll(_SUBSCRIBED_MS):
        raise SystemExit("subscriber: nothing is published; is the address right?")
    socket.recv_multipart()
    socket.setsockopt(zmq.UNSUBSCRIBE, _HEALTH)


def main() -> None:
    """Count until told to quit, then report what is left in the socket too."""
    child = begin(_GRACE_S)
    count = Count()
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.setsockopt(zmq.RCVHWM, 64)
        socket.setsockopt(zmq.SUBSCRIBE, _TRIPLET)
        socket.setsockopt(zmq.SUBSCRIBE, _HEALTH)
        socket.connect(child.config["address"])
        _await_subscription(socket)
        child.control.send({"report": "ready"})
        poller = zmq.Poller()
        poller.register(socket, zmq.POLLIN)
        poller.register(child.control.fileno(), select.POLLIN)
        while not child.stopping():
            if dict(poller.poll(_WAKE_MS)).get(socket):
                count.receive(socket)
        while socket.poll(_WAKE_MS):
            count.receive(socket)
    arrivals = {"arrivals": count.arrivals} if child.config.get("arrivals") else {}
    child.control.send({"report": "counted", **count.to_json(), **arrivals})


if __name__ == "__main__":
    main()
