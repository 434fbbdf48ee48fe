"""Memory for triplets: slots laid out like the bytes of the log, with a count of holders; allocated once."""

import mmap
import threading
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recorder.log.mcap_layout import PAGE, SlotLayout, round_up
from rig.images.pixels import MONO8, Pixels, Stored

_HUGE_PAGE = 2 * 1024 * 1024


class TripletBuffers:
    """A fixed number of slots in private, prefaulted memory on huge pages.

    Each slot holds one triplet, with room before and after the pixels for the records of the log (`SlotLayout`), so
    that it goes to the disk without a copy. A slot has a count of holders: `acquire` makes the first one, `hold` adds
    one, `release` takes one away; a slot without holders is free. Any thread may call any method.

    Attributes:
        shape: rows and columns of the triplet.
        count: number of slots.
        layout: where pixels and log records stand in a slot.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        count: int,
        cameras: Sequence[tuple[str, tuple[int, int]]] = (),
        kind: Pixels = MONO8,
    ):
        """Reserve the memory.

        Args:
            shape: rows and columns of the triplet.
            count: number of slots.
            cameras: name and columns of each camera, if the pixels of each stand together.
            kind: how triplets hold their pixels.
        """
        self.shape = shape
        self.count = count
        self.layout = SlotLayout(shape, cameras, kind)
        slot_bytes = self.layout.slot_bytes
        memory = mmap.mmap(
            -1, round_up(count * slot_bytes, _HUGE_PAGE) + _HUGE_PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        )
        if hasattr(mmap, "MADV_HUGEPAGE"):
            memory.madvise(mmap.MADV_HUGEPAGE)
        everything = np.frombuffer(memory, np.uint8)
        # Huge pages start at multiples of their size; from there on every slot starts on a (small) page.
        first = -int(everything.ctypes.data) % _HUGE_PAGE
        everything[first : first + count * slot_bytes : PAGE] = 0  # touched now, not while recording
        self._slots = [everything[first + slot * slot_bytes : first + (slot + 1) * slot_bytes] for slot in range(count)]
        self._bytes = [slot.data for slot in self._slots]
        self._images = [self._images_in(slot) for slot in self._slots]
        self._freed = threading.Condition()
        self._holders = [0] * count
        self._free = deque(range(count))

    @property
    def free_count(self) -> int:
        """Slots that nobody holds."""
        return len(self._free)

    def acquire(self, timeout_s: float = 0.0) -> int | None:
        """A free slot, held once by the caller; None if there is none within `timeout_s`.

        Its pixels are those of an earlier triplet.
        """
        with self._freed:
            if not self._free and not (timeout_s and self._freed.wait_for(lambda: self._free, timeout_s)):
                return None
            # Take the slot that has been free longest: one that has just gone to the disk costs more to write again.
            slot = self._free.popleft()
            self._holders[slot] = 1
            return slot

    def hold(self, slot: int) -> None:
        """Add a holder to a slot that is held already.

        Raises:
            ValueError: nobody holds it.
        """
        with self._freed:
            if self._holders[slot] < 1:
                raise ValueError(f"slot {slot} is free: acquire one first")
            self._holders[slot] += 1

    def release(self, slot: int) -> None:
        """Take one holder away; the last one frees the slot.

        Raises:
            ValueError: nobody holds it.
        """
        with self._freed:
            if self._holders[slot] < 1:
                raise ValueError(f"slot {slot} is free: it was released once too often")
            self._holders[slot] -= 1
            if not self._holders[slot]:
                self._free.append(slot)
                self._freed.notify()

    def pixels(self, slot: int) -> Stored:
        """The slot's triplet, (rows, columns), C-contiguous.

        In place, always the same view; a new copy if the pixels of each camera stand together.
        """
        images = self._images[slot]
        return images[0] if len(images) == 1 else np.hstack(images)

    def block(self, slot: int, columns: tuple[int, int]) -> Stored:
        """A camera's pixels of the slot in place, (rows, columns).

        Args:
            slot: which slot.
            columns: first column in the triplet, and one past the last.
        """
        for layout, image in zip(self.layout.images, self._images[slot], strict=True):
            first, end = layout.columns
            if first <= columns[0] and columns[1] <= end:
                return image[:, columns[0] - first : columns[1] - first]
        raise ValueError(f"columns {columns} are not those of a camera")

    def write(self, slot: int, triplet: Stored | int) -> None:
        """Copy a triplet, (rows, columns), into the slot, or fill it with a grey value."""
        for layout, image in zip(self.layout.images, self._images[slot], strict=True):
            first, end = layout.columns
            np.copyto(image, triplet if isinstance(triplet, int) else triplet[:, first:end])

    def memory(self, slot: int) -> memoryview:
        """All bytes of the slot, page-aligned; always the same view."""
        return self._bytes[slot]

    def close(self) -> None:
        """Release the memory; the system gets it back when nobody holds a view on it any more."""
        with self._freed:
            self._free.clear()
        self._bytes.clear()
        self._images.clear()
        self._slots.clear()

    def _images_in(self, slot: NDArray[np.uint8]) -> list[Stored]:
        rows, kind = self.shape[0], self.layout.kind.dtype
        return [slot[image.start : image.end].view(kind).reshape(rows, -1) for image in self.layout.images]
