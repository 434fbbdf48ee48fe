"""The isochronous half of an open file: its allocations, its receive context, its ring of frames."""

import errno
import mmap
import struct
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import host_now
from simrig.firewire.host import abi
from simrig.firewire.host.abi import Event
from simrig.firewire.host.receive_context import ReceiveContext, buffers
from simrig.firewire.isochronous import CHANNELS, Allocation, IsoResources, Transmission

_QUADLET: Final = 4
_RECEIVE: Final = 1  # FW_CDEV_ISO_CONTEXT_RECEIVE
_HANDLE: Final = 0  # the kernel allows one context per file
_IIDC_TAG: Final = 1  # bit 0: packets with tag 0


class Refused(Exception):  # noqa: N818  (an answer, not a fault)
    """The kernel would answer this ioctl with this error number."""

    def __init__(self, number: int) -> None:
        super().__init__(errno.errorcode[number])
        self.number = number


class IsoFile:
    """Carries out a file's isochronous ioctls. Each takes its argument and returns it as the kernel leaves it.

    Args:
        resources: channels and bandwidth of the bus.
        tell: queues an event for the program.
    """

    def __init__(self, resources: IsoResources, tell: Callable[[bytes], None]) -> None:
        self._resources, self._tell = resources, tell
        self._context: ReceiveContext | None = None
        self._ring: NDArray[np.uint8] | None = None
        self._allocations: dict[int, tuple[Allocation, int]] = {}

    @property
    def receiving(self) -> bool:
        """Whether the file receives packets."""
        return self._context is not None and self._context.running

    def receive(self, frame: Transmission) -> None:
        """Receive a frame that was sent on the bus, if it is on the file's channel."""
        if self._context is not None and self._ring is not None and self._context.channel == frame.channel:
            self._context.receive(frame, self._ring)

    def drop_context(self) -> None:
        """Receive no more, because the node is gone."""
        self._context = None

    def release(self) -> None:
        """Free all allocations and drop context and ring."""
        for allocation, _ in self._allocations.values():
            self._resources.free(allocation)
        self._allocations.clear()
        self._context = self._ring = None

    def map(self, argument: bytes, memory: int) -> None:
        """Map the ring, the memory that frames are received into.

        Args:
            argument: its length.
            memory: its descriptor; the caller closes it.
        """
        (length,) = struct.unpack("=Q", argument)
        self._ring = np.frombuffer(mmap.mmap(memory, length), np.uint8)

    def allocate(self, argument: bytes) -> tuple[bytes, bytes]:
        """ALLOCATE_ISO_RESOURCE; returns the argument, and the event that follows."""
        closure, channels, bandwidth, _ = abi.RESOURCE.unpack(argument)
        handle = next(number for number in range(len(self._allocations) + 1) if number not in self._allocations)
        allocation = self._resources.allocate(channels, bandwidth)
        if allocation.granted:
            self._allocations[handle] = allocation, closure
        got = allocation.channel, allocation.bandwidth
        event = abi.iso_resource(Event.ISO_RESOURCE_ALLOCATED, closure, handle, *got)
        return abi.RESOURCE.pack(closure, channels, bandwidth, handle), event

    def deallocate(self, argument: bytes) -> bytes:
        """DEALLOCATE_ISO_RESOURCE; returns the event that follows."""
        (handle,) = abi.HANDLE.unpack(argument)
        if handle not in self._allocations:
            raise Refused(errno.EINVAL)
        allocation, closure = self._allocations.pop(handle)
        self._resources.free(allocation)
        got = allocation.channel, allocation.bandwidth
        return abi.iso_resource(Event.ISO_RESOURCE_DEALLOCATED, closure, handle, *got)

    def create_context(self, argument: bytes, version: int) -> bytes:
        """CREATE_ISO_CONTEXT by a program that knows version `version` of the interface."""
        kind, header_bytes, channel, speed, closure, _ = abi.CONTEXT.unpack(argument)
        if self._context is not None:
            raise Refused(errno.EBUSY)
        if kind != _RECEIVE or channel >= CHANNELS or header_bytes not in {4, 8}:
            raise Refused(errno.EINVAL)

        def tell(cycle: int, headers: bytes) -> None:
            self._tell(abi.iso_interrupt(closure, cycle, headers))

        drops = version < abi.DROPS_HEADERS_BELOW
        self._context = ReceiveContext(channel, header_bytes, tell, drops_headers=drops)
        return abi.CONTEXT.pack(kind, header_bytes, channel, speed, closure, _HANDLE)

    def queue(self, argument: bytes, packets: bytes) -> tuple[int, bytes]:
        """QUEUE_ISO; returns the number of packet descriptions queued, and the argument."""
        _, data, size, handle = abi.QUEUE.unpack(argument)
        context = self._known_context(handle)
        controls = struct.unpack(f"={size // _QUADLET}I", packets)
        try:
            entries = buffers(controls, data, context.header_bytes)
        except ValueError:
            raise Refused(errno.EINVAL) from None
        end = data + sum(control & 0xFFFF for control in controls)
        if self._ring is None or end > len(self._ring):
            raise Refused(errno.EINVAL)
        context.queue(entries)
        return len(controls), abi.QUEUE.pack(0, end, 0, handle)

    def start(self, argument: bytes) -> None:
        """START_ISO."""
        _, sync, tags, handle = abi.START.unpack(argument)
        context = self._known_context(handle)
        if not 0 < tags <= 0xF or sync > 0xF:
            raise Refused(errno.EINVAL)
        if tags & _IIDC_TAG:  # otherwise no packet on this bus matches
            context.start(host_now())

    def stop(self, argument: bytes) -> None:
        """STOP_ISO."""
        self._known_context(abi.HANDLE.unpack(argument)[0]).stop()

    def _known_context(self, handle: int) -> ReceiveContext:
        if self._context is None or handle != _HANDLE:
            raise Refused(errno.EINVAL)
        return self._context
