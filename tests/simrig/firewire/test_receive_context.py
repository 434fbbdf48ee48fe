"""The receive DMA by itself: the short cut for whole frames must not be told from packet by packet."""

import struct

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.clocks import HostNs
from rig.pulse import HillPulse
from simrig.firewire.camera.config_rom import camera_rom, crc16, host_rom
from simrig.firewire.host.abi import PAGE
from simrig.firewire.host.receive_context import ReceiveContext, buffers
from simrig.firewire.isochronous import Transmission

PACKETS, SIZE, START = 24, 32, HostNs(1_000_000_000)
WAIT, INTERRUPT = 1 << 17, 1 << 16


def frame(fill: int, lost: frozenset[int] = frozenset(), packets: int = PACKETS) -> Transmission:
    data = np.full(packets * SIZE, fill, np.uint8)
    data[::SIZE] = np.arange(packets) % 256
    return Transmission(3, data, SIZE, packets, 8000 * 9 + 7990, START, lost, HillPulse(fill))


class Receiver:
    def __init__(self, frames: int, packets: int = PACKETS, *, drops_headers: bool = True) -> None:
        self.ring: NDArray[np.uint8] = np.zeros(frames * packets * SIZE, np.uint8)
        self.events: list[tuple[int, list[tuple[int, int]]]] = []
        self.context = ReceiveContext(3, 8, self._interrupt, drops_headers=drops_headers)
        groups = packets // 8
        words = [8 * 8 << 24 | 8 * SIZE] * groups
        words[0] |= WAIT
        words[-1] |= INTERRUPT
        for index in range(frames):
            self.context.queue(buffers(tuple(words), index * packets * SIZE, 8))
        self.context.start(START)

    def _interrupt(self, cycle: int, headers: bytes) -> None:
        self.events.append((cycle, list(struct.iter_unpack(">II", headers))))


def test_libdc1394s_words_become_one_entry() -> None:
    words = (WAIT | 64 << 24 | 256, 64 << 24 | 256, INTERRUPT | 32 << 24 | 128)
    (entry,) = buffers(words, 1000, 8)
    assert (entry.offset, entry.size, entry.count, entry.waits, entry.interrupts) == (1000, 32, 20, True, True)
    assert len(buffers(words * 2, 0, 8)) == 2
    with pytest.raises(ValueError, match="whole number"):
        buffers((12 << 24 | 64,), 0, 8)


def test_a_whole_frame_at_once_is_as_packet_by_packet() -> None:
    at_once, one_by_one = Receiver(2), Receiver(2)
    for fill in (1, 2):
        at_once.context.receive(frame(fill), at_once.ring)
        one_by_one.context._receive_run(frame(fill), one_by_one.ring, range(PACKETS))
    assert at_once.events == one_by_one.events
    assert len(at_once.events) == 2
    assert np.array_equal(at_once.ring, one_by_one.ring)
    cycle, headers = at_once.events[0]
    assert headers[0] == (SIZE << 16 | 3 << 8 | 0xA0 | 1, 1 << 13 | 7990), "sync code; second 9 of 8 is 1"
    assert headers[10] == (SIZE << 16 | 3 << 8 | 0xA0, 2 << 13 | 0), "the next second"
    assert cycle == headers[-1][1]


def test_a_lost_packet_shifts_until_the_next_frame_begins() -> None:
    receiver = Receiver(3)
    for fill, lost in ((1, {5}), (2, set()), (3, set())):
        receiver.context.receive(frame(fill, frozenset(lost)), receiver.ring)
    assert len(receiver.events) == 2
    first = receiver.ring[: PACKETS * SIZE].reshape(PACKETS, SIZE)
    assert list(first[:, 0]) == [0, 1, 2, 3, 4, *range(6, PACKETS), 0]
    assert first[-1, 1] == 2, "the first packet of the frame after"
    assert receiver.ring[PACKETS * SIZE + 1] == 3


def test_without_buffers_packets_are_lost() -> None:
    receiver = Receiver(1)
    for fill in (1, 2):
        receiver.context.receive(frame(fill), receiver.ring)
    assert len(receiver.events) == 1
    words = (WAIT | INTERRUPT | 192 << 24 | PACKETS * SIZE,)
    receiver.context.queue(buffers(words, 0, 8))
    receiver.context.receive(frame(3), receiver.ring)
    assert len(receiver.events) == 2
    assert receiver.ring[1] == 3


def test_a_context_that_starts_in_mid_frame_waits_for_the_next() -> None:
    receiver = Receiver(2)
    receiver.context.start(HostNs(START + 125_000 * 3 + 1))
    receiver.context.receive(frame(1), receiver.ring)
    assert receiver.events == []
    assert not receiver.ring.any()


@pytest.mark.parametrize(("drops", "counts"), [(True, [PAGE // 8]), (False, [PAGE // 8, 960 - PAGE // 8])])
def test_headers_beyond_a_page(drops: bool, counts: list[int]) -> None:
    receiver = Receiver(1, 960, drops_headers=drops)
    receiver.context.receive(frame(1, packets=960), receiver.ring)
    assert [len(headers) for _, headers in receiver.events] == counts


def test_check_sums_of_configuration_roms() -> None:
    assert crc16([0x31333934]) != crc16([0x31333935])
    for rom in (camera_rom(0x000A4701011B0001, "AVT", "Marlin F080B"), host_rom(1)):
        head = rom[0]
        assert head & 0xFFFF == crc16(list(rom[1 : 1 + (head >> 16 & 0xFF)]))
        at = 5
        while at < len(rom):
            length = rom[at] >> 16
            assert rom[at] & 0xFFFF == crc16(list(rom[at + 1 : at + 1 + length]))
            at += 1 + length
        assert at == len(rom)
    # IEEE 1212's CRC-16 of an all-zero quadlet is 0; of a single 1, x^16 + x^12 + x^5 + 1 without x^16.
    assert (crc16([0]), crc16([1])) == (0, 0x1021)
