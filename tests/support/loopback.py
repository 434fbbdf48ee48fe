"""Loopback addresses that no other test on this machine uses at the same time.

Any process may bind any address of 127.0.0.0/8 without set-up, but every GigE Vision camera listens on port 3956:
two tests at once need two addresses. A worker of pytest-xdist takes a block of 256 addresses for its whole session and
holds it by a guard socket, so that a second test run beside this one takes another block.
"""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_GUARD_PORT = 3955
_BLOCKS = 256


@dataclass(frozen=True, slots=True)
class Loopback:
    """A block of addresses, e.g. 127.10.0.1 to 127.10.0.253."""

    block: str

    @property
    def host(self) -> str:
        """An address for services."""
        return f"{self.block}.1"

    def cameras(self, count: int) -> tuple[str, ...]:
        """Addresses for `count` cameras: .11, .12, ..."""
        return tuple(f"{self.block}.{11 + index}" for index in range(count))

    def free_port(self) -> int:
        """A TCP port of `host` that is free now; nobody but this worker takes ports there."""
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.bind((self.host, 0))
            port: int = probe.getsockname()[1]
            return port

    def endpoint(self) -> str:
        """A ZeroMQ address that is free now."""
        return f"tcp://{self.host}:{self.free_port()}"


@contextmanager
def claim(worker: int) -> Iterator[Loopback]:
    """Hold a block of addresses for worker number `worker`.

    Raises:
        RuntimeError: all blocks are taken.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as guard:
        for block in range(_BLOCKS):
            prefix = f"127.{10 + worker}.{block}"
            try:
                guard.bind((f"{prefix}.254", _GUARD_PORT))
            except OSError:
                continue
            yield Loopback(prefix)
            return
    raise RuntimeError(f"all {_BLOCKS} loopback blocks of worker {worker} are taken; end the other test runs")
