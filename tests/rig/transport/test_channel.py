"""The control channel: whole messages in order, end of the other side, no wait for a side that does not read."""

import socket
import threading
from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from rig.transport.channel import ControlChannel
from rig.transport.message import Message

Channel = ControlChannel[dict[str, Any]]


@pytest.fixture
def ends() -> Iterator[tuple[Channel, Channel]]:
    ours, theirs = (Channel(sock, dict[str, Any]) for sock in socket.socketpair())
    yield ours, theirs
    ours.close()
    theirs.close()


class _State(Message):
    """Tells a state."""

    is_state: ClassVar[bool] = True
    number: int
    text: str = "x" * 3000


class _OtherState(_State):
    """Tells another one."""


def _shrink(ends: tuple[Channel, Channel]) -> None:
    for end in ends:
        end._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
        end._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)


def _received(reader: Channel, writer: Channel) -> list[dict[str, Any]]:
    """All that the writer has sent, while both of them turn as their processes do."""
    writer.send({"end": True})
    found: list[dict[str, Any]] = []
    while not found or found[-1] != {"end": True}:
        writer.flush()
        found += reader.receive(0.001)
    return found[:-1]


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
    for message in sent:
        ours.send(message)
    assert _received(theirs, ours) == sent


def test_the_end_of_the_other_side_is_noticed(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    ours.send({"last": True})
    ours.close()
    assert theirs.receive(1.0) == [{"last": True}]
    assert not theirs.ended
    assert theirs.receive(1.0) == []
    assert theirs.ended
    assert not theirs.send({"too": "late"})


def test_a_sleeping_reader_costs_no_time_and_no_event(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    _shrink(ends)
    sent = [{"event": number, "text": "x" * 500} for number in range(2000)]
    assert all(ours.send(message) for message in sent), "a sender that waited would never get here"
    assert ours.waiting
    assert ours.dropped == 0
    assert _received(theirs, ours) == sent


def test_of_states_that_wait_the_latest_of_each_kind_is_kept(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    _shrink(ends)
    for number in range(1000):
        ours.send(_State(number=number))
        if number % 100 == 0:
            ours.send({"event": number})
            ours.send(_OtherState(number=number))
    received = _received(theirs, ours)
    states = [message["number"] for message in received if message.get("type") == "_State"]
    assert states == sorted(set(states)), "in order, none torn, none twice"
    assert len(states) < 20
    assert states[-1] == 999
    assert [message["event"] for message in received if "event" in message] == list(range(0, 1000, 100))
    assert [message["number"] for message in received if message.get("type") == "_OtherState"][-1] == 900
    assert ours.dropped == 0


def test_a_full_queue_loses_its_oldest_messages_and_counts_them(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    _shrink(ends)
    message = {"text": "x" * 100_000}
    for number in range(100):
        ours.send(message | {"number": number})
    assert 0 < ours.dropped < 100
    received = [each["number"] for each in _received(theirs, ours)]
    assert len(received) + ours.dropped == 100
    assert received[0] == 0, "the one that was written in part"
    assert received[1:] == list(range(ours.dropped + 1, 100))


def test_what_waits_goes_out_while_its_sender_waits_for_an_answer(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    _shrink(ends)
    question = {"text": "x" * 300_000}

    def answer() -> None:
        assert theirs.next(30.0) == question
        theirs.send({"answer": 42})

    answerer = threading.Thread(target=answer)
    answerer.start()
    ours.send(question)
    assert ours.next(30.0) == {"answer": 42}
    answerer.join()


def test_the_last_words_of_a_process_are_written(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    _shrink(ends)
    sent = [{"text": "x" * 10_000, "number": number} for number in range(30)]
    received: list[dict[str, Any]] = []

    def read() -> None:
        while len(received) < len(sent):
            received.extend(theirs.receive(30.0))

    reader = threading.Thread(target=read)
    for message in sent:
        ours.send(message)
    ours.drain(0.05)
    assert ours.waiting, "nobody reads"
    reader.start()
    ours.drain(30.0)
    assert not ours.waiting
    reader.join()
    assert received == sent


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
