"""Closes a publisher while a subscriber that stood still leaves, again and again: ADDRESS TIMES."""

import sys
from contextlib import closing

from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.publisher import Publisher
from tests.recorder.logs import acquire
from tests.recorder.publishing.test_publisher import SHAPE, subscriber


def main(address: str, times: int) -> None:
    """Fill the queue of a subscriber that reads nothing, let it leave, and close."""
    for _ in range(times):
        buffers = TripletBuffers(SHAPE, 16)
        with (
            closing(Publisher(address, queue=4)) as publisher,
            subscriber(publisher.address, b"triplet", queue=1),
        ):
            assert publisher.wait_for_subscriber(5)
            for _ in range(14):
                slot = acquire(buffers)
                publisher.triplet(b"{}", buffers, slot)
                buffers.release(slot)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
