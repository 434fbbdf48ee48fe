"""Passes the frames of one camera from grabber to recorder: slots in shared memory and a queue of records.

The memory is an anonymous memfd that the children inherit, so a process that dies leaves nothing behind.
One grabber process writes, one recorder process reads; neither ever waits for the other:

- A slot's owner is one byte: `_FREE -> _GRABBER` and `_GRABBER -> _QUEUED` are written by the grabber alone,
  `_QUEUED -> _FREE` by the recorder alone. A grabber that is started after a crash takes over every slot that
  is not queued.
- The queue is a single-producer single-consumer ring of fixed-size records with two counters that only grow.
  Each counter is an aligned 8-byte word that one side writes; x86-64 keeps the stores of one side in order.
- The grabber takes the lowest free slot, so that frames use as few slots as the recorder's pace allows and stay in
  the processor's cache. The other slots are a reserve for a recorder that falls behind.

```
page 0: header words | slot owners       pages 1..: queue of records        then: slots, page-aligned
```
"""

import mmap
import os
import struct

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInputError
from rig.frame import RECORD_BYTES, FrameRecord, Record, pack_into, unpack_from

_MAGIC = 0x3147_4E49_5256_5653  # "SVVRING1" read as a little-endian word
_HEADER = struct.Struct("<QQQQ")  # magic, frame bytes, slots, queue capacity
_WRITTEN, _READ, _RECONNECT, _OVERFLOW = 16, 24, 32, 40  # word numbers, a cache line each
_COUNTERS = 64
_OWNERS = 1024
MAX_SLOTS = mmap.PAGESIZE - _OWNERS

_FREE, _GRABBER, _QUEUED = b"\0", b"\1", b"\2"

_MADV_POPULATE_WRITE = 23  # linux/mman.h; not yet named in the mmap module

#: The grabber's counters, in the order of their words in the header.
COUNTERS = ("frames", "damaged", "underruns", "resent_packets", "missing_packets", "reconnects", "temperature_mdeg")


def _pages(size: int) -> int:
    return -(-size // mmap.PAGESIZE) * mmap.PAGESIZE


class CameraRing:
    """Slots and record queue of one camera, mapped into the address space of this process.

    Args:
        fd: descriptor of the memfd.

    Attributes:
        fd: as given; children inherit it.
        frame_bytes: size of one frame, bytes.
        slots: number of slots.
        address: where the memory begins in this process.

    Raises:
        BadInputError: the descriptor is of something else.
    """

    def __init__(self, fd: int) -> None:
        self.fd = fd
        magic, self.frame_bytes, self.slots, self._capacity = _HEADER.unpack(os.pread(fd, _HEADER.size, 0))
        if magic != _MAGIC:
            raise BadInputError(f"file descriptor {fd} is no camera ring: start the process through svev")
        self._stride = _pages(self.frame_bytes)
        self._first = mmap.PAGESIZE + _pages(self._capacity * RECORD_BYTES)
        self._map = mmap.mmap(fd, os.fstat(fd).st_size)
        self._view = memoryview(self._map)
        self._words = self._view[: mmap.PAGESIZE].cast("Q")
        self._queue = self._view[mmap.PAGESIZE : self._first]
        bytes_ = np.frombuffer(self._map, np.uint8)
        self.address = int(bytes_.ctypes.data)
        frames = bytes_[self._first :].reshape(self.slots, self._stride)
        self._frames = [frames[slot, : self.frame_bytes] for slot in range(self.slots)]

    @classmethod
    def create(cls, name: str, frame_bytes: int, slots: int, queue: int = 1024) -> "CameraRing":
        """Make the shared memory of one camera.

        Args:
            name: name that the kernel shows in /proc/PID/maps.
            frame_bytes: size of one frame, bytes.
            slots: number of frames that the ring holds.
            queue: number of records that the queue holds.

        Raises:
            BadInputError: too many slots.
        """
        if not 2 <= slots <= MAX_SLOTS:
            raise BadInputError(f"a ring of {slots} slots: choose recorder.ring_s for 2 to {MAX_SLOTS} frames")
        fd = os.memfd_create(f"svev-{name}", os.MFD_CLOEXEC)
        os.ftruncate(fd, mmap.PAGESIZE + _pages(queue * RECORD_BYTES) + slots * _pages(frame_bytes))
        os.pwrite(fd, _HEADER.pack(_MAGIC, frame_bytes, slots, queue), 0)
        return cls(fd)

    def prefault(self) -> None:
        """Have the kernel provide all pages now: the first access to a page while recording would cost milliseconds."""
        self._map.madvise(mmap.MADV_HUGEPAGE)
        self._map.madvise(_MADV_POPULATE_WRITE)

    def close(self) -> None:
        """Unmap the memory and close the descriptor. No view of a frame may be in use any more."""
        self._frames.clear()
        self._words.release()
        self._queue.release()
        self._view.release()
        self._map.close()
        os.close(self.fd)

    def frame(self, slot: int) -> NDArray[np.uint8]:
        """The bytes of one slot, shape (frame_bytes,)."""
        return self._frames[slot]

    def slot_address(self, slot: int) -> int:
        """Address of one slot in this process."""
        return self.address + self._first + slot * self._stride

    # The grabber's side

    def reclaim(self) -> None:
        """Free the slots that a dead grabber held."""
        for slot in range(self.slots):
            if self._map[_OWNERS + slot] == _GRABBER[0]:
                self._map[_OWNERS + slot] = _FREE[0]

    def take_slot(self) -> int | None:
        """Take the lowest free slot for the grabber; None if the recorder holds all slots."""
        place = self._map.find(_FREE, _OWNERS, _OWNERS + self.slots)
        if place < 0:
            return None
        self._map[place] = _GRABBER[0]
        return place - _OWNERS

    def return_slot(self, slot: int) -> None:
        """Free a slot that the grabber took and did not queue."""
        self._map[_OWNERS + slot] = _FREE[0]

    def put(self, record: Record, epoch: int) -> bool:
        """Queue a record; the slot of a frame belongs to the recorder from now on.

        Args:
            record: the record.
            epoch: number of the connection.

        Returns:
            False if the queue is full: the record is not queued, and the overflow is counted.
        """
        written = self._words[_WRITTEN]
        if written - self._words[_READ] >= self._capacity:
            self._words[_OVERFLOW] += 1
            return False
        if isinstance(record, FrameRecord):
            self._map[_OWNERS + record.slot] = _QUEUED[0]
        pack_into(record, epoch, self._queue, written % self._capacity * RECORD_BYTES)
        self._words[_WRITTEN] = written + 1
        return True

    def count(self, name: str, value: int) -> None:
        """Set one of `COUNTERS`."""
        self._words[_COUNTERS + COUNTERS.index(name)] = value

    def reconnect_requests(self) -> int:
        """How many times the recorder has asked for a new connection of the camera."""
        return self._words[_RECONNECT]

    # The recorder's side

    def get(self) -> Record | None:
        """Remove and return the next record; None if the queue is empty."""
        read = self._words[_READ]
        if read == self._words[_WRITTEN]:
            return None
        record = unpack_from(self._queue, read % self._capacity * RECORD_BYTES)
        self._words[_READ] = read + 1
        return record

    def release(self, slot: int) -> None:
        """Free a slot that the recorder has finished with."""
        self._map[_OWNERS + slot] = _FREE[0]

    def queued_slots(self) -> set[int]:
        """The slots that the grabber has queued and the recorder has not freed."""
        return {slot for slot in range(self.slots) if self._map[_OWNERS + slot] == _QUEUED[0]}

    def unread_slots(self) -> set[int]:
        """The slots that are named by records still in the queue."""
        read, written = self._words[_READ], self._words[_WRITTEN]
        places = (number % self._capacity * RECORD_BYTES for number in range(read, written))
        records = (unpack_from(self._queue, place) for place in places)
        return {record.slot for record in records if isinstance(record, FrameRecord)}

    def request_reconnect(self) -> None:
        """Ask the grabber to disconnect the camera and set it up anew."""
        self._words[_RECONNECT] += 1

    # For health

    def counters(self) -> dict[str, int]:
        """The grabber's counters, and two more: records that found the queue full, and slots that are queued."""
        values = {name: self._words[_COUNTERS + i] for i, name in enumerate(COUNTERS)}
        values["queue_overflows"] = self._words[_OVERFLOW]
        values["slots_queued"] = self._map[_OWNERS : _OWNERS + self.slots].count(_QUEUED)
        return values
