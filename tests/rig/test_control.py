"""The control channel: messages whole and in order, the end of the other side, and no waiting for one that sleeps."""

import socket
import time
from collections.abc import Iterator

import pytest

from rig.control import ControlChannel


@pytest.fixture
def ends() -> Iterator[tuple[ControlChannel, ControlChannel]]:
    ours, theirs = (ControlChannel(sock) for sock in socket.socketpair())
    yield ours, theirs
    ours.close()
    theirs.close()


def test_messages_come_whole_and_in_order(ends: tuple[ControlChannel, ControlChannel]) -> None:
    ours, theirs = ends
    sent = [{"number": number, "text": "æøå\n" * number} for number in range(200)]
    received: list[object] = []
    for message in sent:
        assert ours.send(message)
        received += theirs.receive(0)
    while len(received) < len(sent):
        received += theirs.receive(1.0)
    assert received == sent


def test_the_end_of_the_other_side_is_noticed(ends: tuple[ControlChannel, ControlChannel]) -> None:
    ours, theirs = ends
    ours.send({"last": True})
    ours.close()
    assert theirs.receive(1.0) == [{"last": True}]
    assert not theirs.ended
    assert theirs.receive(1.0) == []
    assert theirs.ended
    assert not theirs.send({"too": "late"})


def test_a_sleeping_reader_costs_messages_but_no_time(ends: tuple[ControlChannel, ControlChannel]) -> None:
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
