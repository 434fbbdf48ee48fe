"""Publication over real sockets: nothing copied, nothing blocked, slots come back."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
import zmq

from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.publisher import Publisher
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.events import Event, Level
from tests.recorder.logs import acquire
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

SHAPE = (240, 960)  # larger than what ZeroMQ copies rather than refers to


@contextmanager
def subscriber(address: str, *topics: bytes, queue: int = 1000) -> Iterator["zmq.Socket[bytes]"]:
    """A SUB socket."""
    with zmq.Context() as context, context.socket(zmq.SUB) as sub:
        sub.linger = 0
        sub.rcvtimeo = 10_000
        sub.rcvhwm = queue
        if queue == 1:
            sub.rcvbuf = 4096
        for topic in topics:
            sub.subscribe(topic)
        sub.connect(address)
        yield sub


@pytest.fixture
def buffers() -> TripletBuffers:
    return TripletBuffers(SHAPE, 16)


def _publish(publisher: Publisher, buffers: TripletBuffers, pulse: int) -> None:
    """Publish one triplet, all pixels of the pulse's number, as the recorder does."""
    slot = acquire(buffers)
    buffers.pixels(slot).fill(pulse % 256)
    publisher.triplet(b'{"pulse":%d}' % pulse, buffers, slot)
    buffers.release(slot)


def _pulse(message: list[bytes]) -> int:
    """The pulse of a received triplet, whose image must be its own."""
    topic, tag, image = message
    assert topic == b"triplet"
    pulse: int = json.loads(tag)["pulse"]
    assert len(image) == SHAPE[0] * SHAPE[1]
    assert (np.frombuffer(image, np.uint8) == pulse % 256).all()
    return pulse


def test_a_subscriber_gets_every_triplet_bit_by_bit(loopback: Loopback, buffers: TripletBuffers) -> None:
    with closing(Publisher(loopback.endpoint())) as publisher, subscriber(publisher.address, b"triplet") as sub:
        assert publisher.wait_for_subscriber(5)
        for pulse in range(1, 101):  # many more than there are slots
            wait_until(lambda: publisher.held < 8, "ZeroMQ let go of slots that were received")
            _publish(publisher, buffers, pulse)
            assert _pulse(sub.recv_multipart()) == pulse
        assert (publisher.sent, publisher.dropped) == (100, 0)
        wait_until(lambda: publisher.held == 0, "ZeroMQ let go of all slots")
        assert buffers.free_count == 16


def test_without_a_subscriber_nothing_is_handed_over(loopback: Loopback, buffers: TripletBuffers) -> None:
    with closing(Publisher(loopback.endpoint())) as publisher:
        assert not publisher.wait_for_subscriber(0.0)
        _publish(publisher, buffers, 1)
        assert (publisher.sent, publisher.held, publisher.dropped) == (0, 0, 0)


def test_who_subscribes_to_events_gets_no_triplets(loopback: Loopback, buffers: TripletBuffers) -> None:
    with (
        closing(Publisher(loopback.endpoint())) as publisher,
        subscriber(publisher.address, b"event", b"health") as sub,
    ):
        wait_until(lambda: _hears(publisher, sub), "the subscription has arrived")
        _publish(publisher, buffers, 1)
        publisher.health(b'{"free":3}')
        assert sub.recv_multipart() == [b"health", b'{"free":3}']
        assert publisher.sent == 0


def _hears(publisher: Publisher, sub: "zmq.Socket[bytes]") -> bool:
    publisher.event(Event(UtcNs(7), Level.INFO, "test", "hello"))
    if not sub.poll(20):
        return False
    while sub.poll(20):
        assert sub.recv_multipart() == [b"event", b'{"time_ns":"7","level":"info","name":"test","message":"hello"}']
    return True


def test_an_image_is_not_copied_and_its_slot_is_held_while_it_is_sent(
    loopback: Loopback, buffers: TripletBuffers
) -> None:
    with (
        closing(Publisher(loopback.endpoint())) as publisher,
        subscriber(publisher.address, b"triplet", queue=1) as sub,
    ):
        assert publisher.wait_for_subscriber(5)
        for pulse in range(1, 13):  # more than the network takes while nobody reads
            _publish(publisher, buffers, pulse)
        assert publisher.held > 0
        assert buffers.free_count == 16 - publisher.held
        # What was queued is still what it was, although free slots are written again and again.
        for _ in range(40):
            slot = acquire(buffers)
            buffers.pixels(slot).fill(255)
            buffers.release(slot)
        seen = [_pulse(sub.recv_multipart())]
        while publisher.held or sub.poll(100):
            seen.append(_pulse(sub.recv_multipart()))
        assert seen == sorted(seen)


def test_a_subscriber_that_stands_still_blocks_nobody(loopback: Loopback, buffers: TripletBuffers) -> None:
    with closing(Publisher(loopback.endpoint(), queue=4)) as publisher:
        with subscriber(publisher.address, b"triplet", queue=1), subscriber(publisher.address, b"triplet") as good:
            assert publisher.wait_for_subscriber(5)
            wait_until(lambda: _arrives(publisher, buffers, good), "both are connected")
            for pulse in range(1, 101):
                wait_until(lambda: publisher.held < 12, "ZeroMQ let go of slots that the good one received")
                _publish(publisher, buffers, pulse)
                assert _next_pulse(good) == pulse
            assert publisher.dropped == 0
            assert buffers.free_count >= 16 - 12
            publisher.close()
        wait_until(lambda: buffers.free_count == 16, "all slots are free")


@pytest.mark.long
def test_closing_ends_although_a_subscriber_that_stands_still_leaves_at_that_moment(loopback: Loopback) -> None:
    """In a program of its own: of one in some 300 ends, threads of ZeroMQ may remain."""
    module = "tests.recorder.publishing.leaving_subscriber"
    done = subprocess.run([sys.executable, "-m", module, loopback.endpoint(), "300"], timeout=120, check=False)
    assert done.returncode == 0


def _arrives(publisher: Publisher, buffers: TripletBuffers, sub: "zmq.Socket[bytes]") -> bool:
    _publish(publisher, buffers, 0)
    return bool(sub.poll(50))


def _next_pulse(sub: "zmq.Socket[bytes]") -> int:
    """The next pulse that is none of those by which the connection was tried."""
    while not (pulse := _pulse(sub.recv_multipart())):
        pass
    return pulse


def test_when_too_many_slots_are_out_triplets_are_dropped_and_counted(loopback: Loopback) -> None:
    buffers = TripletBuffers(SHAPE, 6)  # of which 2 may be with ZeroMQ
    with closing(Publisher(loopback.endpoint(), queue=100)) as publisher:
        with subscriber(publisher.address, b"triplet", queue=1):
            assert publisher.wait_for_subscriber(5)
            for pulse in range(1, 200):
                _publish(publisher, buffers, pulse)
                assert buffers.free_count >= 4
            assert publisher.dropped > 0
            assert publisher.sent + publisher.dropped == 199
            publisher.close()
        wait_until(lambda: buffers.free_count == 6, "all slots are free")


def test_a_pulse_without_pixels_has_an_empty_image(loopback: Loopback, buffers: TripletBuffers) -> None:
    with closing(Publisher(loopback.endpoint())) as publisher, subscriber(publisher.address, b"triplet") as sub:
        assert publisher.wait_for_subscriber(5)
        publisher.triplet(b"{}", buffers, None)
        assert sub.recv_multipart() == [b"triplet", b"{}", b""]


def test_the_second_address_serves_the_same(loopback: Loopback, short_path: Path, buffers: TripletBuffers) -> None:
    ipc = f"ipc://{short_path}/live"
    with closing(Publisher(loopback.endpoint(), ipc)) as publisher, subscriber(ipc, b"") as sub:
        assert publisher.wait_for_subscriber(5)
        _publish(publisher, buffers, 7)
        assert _pulse(sub.recv_multipart()) == 7


def test_an_address_in_use_is_named(loopback: Loopback, short_path: Path) -> None:
    ipc = f"ipc://{short_path}/live"
    with closing(Publisher(loopback.endpoint(), ipc)) as publisher:
        for address in (publisher.address, ipc):
            with pytest.raises(BadInputError, match=f"{address}: address in use; stop the other publisher or choose"):
                Publisher(address)


def test_a_socket_file_that_a_dead_publisher_left_is_no_obstacle(short_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(short_path / "live"))
    with closing(Publisher(f"ipc://{short_path}/live")) as publisher, subscriber(publisher.address, b"triplet"):
        assert publisher.wait_for_subscriber(5)


@pytest.mark.parametrize(
    "address", ["tcp://192.0.2.1:5556", "tcp://127.0.0.1:99999", "nonsense", "ipc:///nowhere/live"]
)
def test_an_address_that_cannot_be_bound_is_named(address: str) -> None:
    with pytest.raises(BadInputError, match=r"cannot be bound .*; use e\.g\. tcp"):
        Publisher(address)


def test_an_open_port_is_filled_in(loopback: Loopback) -> None:
    with closing(Publisher(f"tcp://{loopback.host}:*")) as publisher:
        assert publisher.address.startswith(f"tcp://{loopback.host}:")
        assert not publisher.address.endswith("*")
