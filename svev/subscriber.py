"""A counting subscriber beside a recording: started, awaited, asked for its count."""

import socket
import time
from types import TracebackType
from typing import Final, Self

from rig.control import Message
from rig.errors import ProcessDiedError
from svev.process_table import ProcessSpec, ProcessTable

_ANSWER_S: Final = 15.0
_NAME: Final = "subscriber"


def free_address() -> str:
    """A ZeroMQ address on loopback whose port is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


class Subscriber:
    """The process of `svev.subscriber_process`; within the context its subscription holds.

    Args:
        address: where triplets are published.
        arrivals: whether to report the time of every message too.

    Raises:
        ProcessDiedError: it does not answer in time.
    """

    def __init__(self, address: str, *, arrivals: bool = False) -> None:
        self._spec = ProcessSpec(_NAME, "svev.subscriber_process", {"address": address, "arrivals": arrivals})
        self._table = ProcessTable()

    def __enter__(self) -> Self:
        self._table.start(self._spec)
        try:
            self._await_report("ready")
        except ProcessDiedError:
            self._table.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._table.stop()

    def count(self) -> Message:
        """End the subscription; what came until now, see `svev.subscriber_process.Count`."""
        self._table[_NAME].control.send({"command": "quit"})
        counted = self._await_report("counted")
        return {key: value for key, value in counted.items() if key != "report"}

    def _await_report(self, wanted: str) -> Message:
        deadline = time.monotonic() + _ANSWER_S
        while time.monotonic() < deadline:
            ended = self._table.dead()  # asked first: what it reported before its end is read below
            for _, message in self._table.receive(0.1):
                if message["report"] == wanted:
                    return message
            if ended:
                break
        raise ProcessDiedError("the subscriber process does not answer: start again")
