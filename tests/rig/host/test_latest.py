"""Of what waits for a slow disk only the latest is written, and a disk that refuses is told of once."""

import threading
from errno import ENOSPC

from rig.host.latest import LatestWriter
from tests.support.waiting import wait_until


def test_only_the_latest_is_written_when_the_disk_takes_something_again() -> None:
    slow, begun, written = threading.Event(), threading.Event(), []

    def first() -> None:
        begun.set()
        slow.wait(10)
        written.append(1)

    writer = LatestWriter("a file", lambda _: None)
    assert writer.wait(0)
    writer.write(first)
    assert begun.wait(10)
    for number in (2, 3, 4):
        writer.write(lambda number=number: written.append(number))  # type: ignore[misc]
    assert not writer.wait(0.01)
    slow.set()
    assert writer.wait(10)
    assert written == [1, 4]
    wait_until(lambda: all(thread.name != "a file" for thread in threading.enumerate()), "its thread has ended")


def test_a_disk_that_refuses_is_told_of_once_until_it_takes_something() -> None:
    told: list[int | None] = []
    writer = LatestWriter("a file", lambda error: told.append(error.errno))

    def refuse() -> None:
        raise OSError(ENOSPC, "the disk is full")

    for order, failed in ((refuse, True), (refuse, True), (lambda: None, False), (refuse, True)):
        writer.write(order)
        assert writer.wait(10)
        assert writer.failed is failed
    assert told == [ENOSPC, ENOSPC]
