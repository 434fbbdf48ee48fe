"""Child process: a subscriber that counts what it gets and how late, as a photogrammetry worker would see it."""

import json
import select
import time
from typing import Any, Final

import zmq

from rig.topics import TRIPLET
from svev.child import begin

_WAKE_MS: Final = 200
_GRACE_S: Final = 5.0


class Count:
    """What came so far.

    Attributes:
        pulses: pulse numbers in the order in which they came.
        latency_ms: for each complete triplet, from the last of its frames in the host's memory to the message here.
    """

    def __init__(self) -> None:
        self.pulses: list[int] = []
        self.latency_ms: list[float] = []
        self.bytes = 0

    def take(self, tag_json: bytes, size: int, now_utc_ns: int) -> None:
        """One message."""
        tag = json.loads(tag_json)
        self.pulses.append(tag["pulse"])
        self.bytes += size
        if tag["complete"]:
            last = max(int(camera["host_time_ns"]) for camera in tag["cameras"])
            self.latency_ms.append((now_utc_ns - last) / 1e6)

    def to_json(self) -> dict[str, Any]:
        """Totals, and what is missing between the first and the last pulse."""
        expected = self.pulses[-1] - self.pulses[0] + 1 if self.pulses else 0
        ordered = sorted(self.latency_ms)
        return {
            "received": len(self.pulses),
            "missing": expected - len(set(self.pulses)),
            "bytes": self.bytes,
            "latency_ms": {"median": _quantile(ordered, 0.5), "p99": _quantile(ordered, 0.99)},
        }


def _quantile(ordered: list[float], fraction: float) -> float | None:
    return round(ordered[min(len(ordered) - 1, int(fraction * len(ordered)))], 3) if ordered else None


def main() -> None:
    """Count until told to quit, then report what is left in the socket too."""
    child = begin(_GRACE_S)
    count = Count()
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.setsockopt(zmq.SUBSCRIBE, (TRIPLET.live or "").encode())
        socket.setsockopt(zmq.RCVHWM, 64)
        socket.connect(child.config["address"])
        child.control.send({"report": "ready"})
        poller = zmq.Poller()
        poller.register(socket, zmq.POLLIN)
        poller.register(child.control.fileno(), select.POLLIN)
        while not child.stopping():
            if dict(poller.poll(_WAKE_MS)).get(socket):
                _, tag, image = socket.recv_multipart(copy=False)
                count.take(tag.bytes, len(image), time.time_ns())
        while socket.poll(_WAKE_MS):
            _, tag, image = socket.recv_multipart(copy=False)
            count.take(tag.bytes, len(image), time.time_ns())
    child.control.send({"report": "counted", **count.to_json()})


if __name__ == "__main__":
    main()
