"""The control channel: whole messages in order, end of the other side, no wait for a side that does not read."""

import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from rig.transport.channel import ControlChannel

Channel = ControlChannel[dict[str, Any]]


@pytest.fixture
def ends() -> Iterator[tuple[Channel, Channel]]:
    ours, theirs = (Channel(sock, dict[str, Any]) for sock in socket.socketpair())
    yield ours, theirs
    ours.close()
    theirs.close()


def test_messages_come_whole_and_in_order(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    sent = [{"number": number, "text": "æøå\n" * number} for number in range(200)]
    received: list[object] = []
    for message in sent:
        assert ours.send(message)
        received += theirs.receive(0)
    while len(received) < len(sent):
        received += theirs.receive(1.0)
    assert received == sent


def test_a_message_larger_than_the_buffers_comes_whole(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    sent = [{"number": 1}, {"text": "x" * 3_000_000}, {"number": 2}]
    writer = threading.Thread(target=lambda: [ours.send(message) for message in sent])
    writer.start()
    received: list[object] = []
    while len(received) < len(sent):
        received += theirs.receive(5.0)
    writer.join()
    assert received == sent


def test_the_end_of_the_other_side_is_noticed(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    ours.send({"last": True})
    ours.close()
    assert theirs.receive(1.0) == [{"last": True}]
    assert not theirs.ended
    assert theirs.receive(1.0) == []
    assert theirs.ended
    assert not theirs.send({"too": "late"})


def test_a_sleeping_reader_costs_messages_but_no_time(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    message = {"report": "health", "text": "x" * 3000}
    before = time.monotonic()
    outcomes = [ours.send(message, or_drop=True) for _ in range(1000)]
    assert time.monotonic() - before < 20.0  # a sender that waited would never get here
    assert outcomes[0]
    assert not outcomes[-1]
    received: list[object] = []
    while len(received) < sum(outcomes):
        received += theirs.receive(1.0)
    assert received == [message] * sum(outcomes), "what was sent came whole"


def test_messages_one_by_one(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    assert theirs.next(0.05) is None
    assert not theirs.ended
    for number in range(3):
        ours.send({"number": number})
    assert theirs.next(1.0) == {"number": 0}
    assert theirs.receive(1.0) == [{"number": 1}, {"number": 2}]
    ours.close()
    assert theirs.next(1.0) is None
    assert theirs.ended
