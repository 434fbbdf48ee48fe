"""One open `/dev/fw*`: its ioctls and events, as the kernel answers them (drivers/firewire/core-cdev.c)."""

import errno
import mmap
import os
import socket
import struct
import time
from collections import deque
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.clocks import NS_PER_US, host_now
from simrig.firewire import abi
from simrig.firewire.abi import Event, Ioctl, Rcode, Tcode
from simrig.firewire.camera import REGISTER_SPACE, Camera
from simrig.firewire.cycle_timer import CycleTimer
from simrig.firewire.iso_resources import Allocation, IsoResources
from simrig.firewire.loop import Loop
from simrig.firewire.receive_context import ReceiveContext, buffers
from simrig.firewire.transmission import Transmission
from simrig.firewire.wire import Operation, Request, receive, reply

_ROM_END: Final = REGISTER_SPACE + 0x800  # broadcasts below would reach the kernel's own registers
_MAX_REQUEST_BYTES: Final = 2048  # asynchronous packet at S400
_QUADLET: Final = 4
_RECEIVE: Final = 1  # FW_CDEV_ISO_CONTEXT_RECEIVE
_CHANNELS: Final = 64
_IIDC_TAG: Final = 1  # bit 0: packets with tag 0
_CARD: Final = 0
_WRITES: Final = (Tcode.WRITE_QUADLET, Tcode.WRITE_BLOCK)
_CLOCK_TRIES: Final = 20
_CLOCK_GAP_NS: Final = 20_000


class Refused(Exception):  # noqa: N818  (an answer, not a fault)
    """An ioctl that the kernel would answer with this error number."""

    def __init__(self, number: int) -> None:
        super().__init__(errno.errorcode[number])
        self.number = number


class Surroundings(Protocol):
    """The bus as a file sees it."""

    generation: int
    timer: CycleTimer
    resources: IsoResources

    def rom(self, node: str) -> tuple[int, ...]:
        """Configuration ROM of a node."""
        ...

    def reset_event(self, node: str, closure: int) -> bytes:
        """The last bus reset, as the node's files are told of it."""
        ...

    def reset(self) -> None:
        """Reset the bus."""
        ...

    def plugged_cameras(self) -> list[Camera]:
        """All cameras on the bus."""
        ...

    def closed(self, file: "OpenFile") -> None:
        """The program has closed the file."""
        ...


class OpenFile:
    """A file from open to close.

    Args:
        bus: what it belongs to.
        node: name of the node, e.g. fw1.
        camera: the node; None: the computer itself.
        loop: serves it.
        connection: its requests.
        events: our end of what the program reads from.
    """

    def __init__(
        self, bus: Surroundings, node: str, camera: Camera | None, loop: Loop, connection: socket.socket,
        events: socket.socket,
    ) -> None:  # fmt: skip
        self._bus, self.node, self._camera, self._loop = bus, node, camera, loop
        self._connection, self._events = connection, events
        self._events.setblocking(False)
        self._unsent: deque[bytes] = deque()
        self._version = abi.KERNEL_VERSION
        self._reset_closure = 0
        self._context: ReceiveContext | None = None
        self._ring: NDArray[np.uint8] | None = None
        self._allocations: dict[int, tuple[Allocation, int]] = {}
        self._gone = False
        loop.when_readable(connection, self._serve)

    @property
    def receiving(self) -> bool:
        """Whether it receives isochronous packets."""
        return self._context is not None and self._context.running

    def receive(self, frame: Transmission) -> None:
        """A frame was sent on the bus."""
        if self._context is not None and self._ring is not None and self._context.channel == frame.channel:
            self._context.receive(frame, self._ring)

    def tell_reset(self) -> None:
        """The bus was reset."""
        self._tell(self._bus.reset_event(self.node, self._reset_closure))

    def unplug(self) -> None:
        """The node is gone: whoever waits for events wakes up, all else fails from now on."""
        self._gone = True
        self._context = None
        self._loop.when_writable(self._events, None)
        self._events.close()

    def close(self) -> None:
        """Let go of everything that the file holds."""
        for allocation, _ in self._allocations.values():
            self._bus.resources.free(allocation)
        self._allocations.clear()
        self._context = self._ring = None
        self._loop.when_readable(self._connection, None)
        self._loop.when_writable(self._events, None)
        self._connection.close()
        self._events.close()

    def _tell(self, event: bytes) -> None:
        """Queue an event; the kernel's queue has no end either, but only what was asked for comes in."""
        if self._gone:
            return
        self._unsent.append(event)
        if len(self._unsent) == 1:
            self._send_events()

    def _send_events(self) -> None:
        try:
            while self._unsent:
                self._events.send(self._unsent[0])
                self._unsent.popleft()
        except BlockingIOError:
            self._loop.when_writable(self._events, self._send_events)
            return
        except (BrokenPipeError, ConnectionResetError):
            self._unsent.clear()  # the program is closing the file
        self._loop.when_writable(self._events, None)

    def _serve(self) -> None:
        """One request, or the end."""
        request = receive(self._connection)
        if request is None:
            self.close()
            self._bus.closed(self)
            return
        try:
            if self._gone:
                reply(self._connection, -errno.ENODEV)
            elif request.operation is Operation.MMAP:
                self._map(request)
                reply(self._connection, 0)
            else:
                self._ioctl(request)
        except Refused as refusal:
            reply(self._connection, -refusal.number)
        finally:
            if request.descriptor >= 0:
                os.close(request.descriptor)

    def _map(self, request: Request) -> None:
        """Share the memory that frames are received into."""
        (length,) = struct.unpack("=Q", request.argument)
        self._ring = np.frombuffer(mmap.mmap(request.descriptor, length), np.uint8)

    def _ioctl(self, request: Request) -> None:
        argument = request.argument
        match request.code & 0xFF:
            case Ioctl.GET_INFO:
                self._get_info(argument)
            case Ioctl.SEND_REQUEST:
                self._send_request(argument, request.extra)
            case Ioctl.SEND_BROADCAST_REQUEST:
                self._send_broadcast(argument, request.extra)
            case Ioctl.INITIATE_BUS_RESET:
                reply(self._connection, 0)
                self._bus.reset()
            case Ioctl.GET_CYCLE_TIMER:
                reply(self._connection, 0, abi.TIMER.pack(*self._cycle_time()))
            case Ioctl.ALLOCATE_ISO_RESOURCE:
                self._allocate(argument)
            case Ioctl.DEALLOCATE_ISO_RESOURCE:
                self._deallocate(argument)
            case Ioctl.CREATE_ISO_CONTEXT:
                self._create_context(argument)
            case Ioctl.QUEUE_ISO:
                self._queue(argument, request.extra)
            case Ioctl.START_ISO:
                self._start(argument)
            case Ioctl.STOP_ISO:
                self._known_context(abi.HANDLE.unpack(argument)[0]).stop()
                reply(self._connection, 0)
            case _:
                raise Refused(errno.ENOTTY)

    def _get_info(self, argument: bytes) -> None:
        self._version, _, _, _, self._reset_closure, _ = abi.INFO.unpack(argument)
        rom = self._bus.rom(self.node)
        info = abi.INFO.pack(abi.KERNEL_VERSION, _QUADLET * len(rom), 0, 0, 0, _CARD)
        event = self._bus.reset_event(self.node, self._reset_closure)
        reply(self._connection, 0, info, event + struct.pack(f"={len(rom)}I", *rom))

    def _send_request(self, argument: bytes, data: bytes) -> None:
        tcode, length, offset, closure, _, generation = abi.REQUEST.unpack(argument)
        quadlet = tcode in {Tcode.WRITE_QUADLET, Tcode.READ_QUADLET}
        if length > _MAX_REQUEST_BYTES:
            raise Refused(errno.EIO)
        if length % _QUADLET or (quadlet and length != _QUADLET):
            raise Refused(errno.EINVAL)
        reply(self._connection, 0)
        if generation != self._bus.generation:
            self._tell(abi.response(closure, Rcode.GENERATION, b""))
        elif self._camera is None:
            self._tell(abi.response(closure, Rcode.ADDRESS_ERROR, b""))
        else:
            self._tell(abi.response(closure, *self._camera.request(tcode, offset, length, data)))

    def _send_broadcast(self, argument: bytes, data: bytes) -> None:
        tcode, length, offset, closure, _, generation = abi.REQUEST.unpack(argument)
        if tcode not in _WRITES:
            raise Refused(errno.EINVAL)
        if offset < _ROM_END:
            raise Refused(errno.EACCES)
        reply(self._connection, 0)
        if generation != self._bus.generation:
            self._tell(abi.response(closure, Rcode.GENERATION, b""))
            return
        for camera in self._bus.plugged_cameras():
            camera.request(tcode, offset, length, data)
        self._tell(abi.response(closure, Rcode.COMPLETE, b""))  # nobody acknowledges a broadcast

    def _cycle_time(self) -> tuple[int, int]:
        """UTC in us and the cycle timer, read as good as together (the kernel does it with interrupts off)."""
        for _ in range(_CLOCK_TRIES):
            before = host_now()
            utc = time.time_ns()
            after = host_now()
            if after - before < _CLOCK_GAP_NS:
                break
        return utc // NS_PER_US, self._bus.timer.register(after)

    def _allocate(self, argument: bytes) -> None:
        closure, channels, bandwidth, _ = abi.RESOURCE.unpack(argument)
        handle = next(number for number in range(len(self._allocations) + 1) if number not in self._allocations)
        reply(self._connection, 0, abi.RESOURCE.pack(closure, channels, bandwidth, handle))
        allocation = self._bus.resources.allocate(channels, bandwidth)
        if allocation.granted:
            self._allocations[handle] = allocation, closure
        event = abi.iso_resource(
            Event.ISO_RESOURCE_ALLOCATED, closure, handle, allocation.channel, allocation.bandwidth
        )
        self._tell(event)

    def _deallocate(self, argument: bytes) -> None:
        (handle,) = abi.HANDLE.unpack(argument)
        if handle not in self._allocations:
            raise Refused(errno.EINVAL)
        allocation, closure = self._allocations.pop(handle)
        reply(self._connection, 0)
        self._bus.resources.free(allocation)
        channel, bandwidth = allocation.channel, allocation.bandwidth
        self._tell(abi.iso_resource(Event.ISO_RESOURCE_DEALLOCATED, closure, handle, channel, bandwidth))

    def _create_context(self, argument: bytes) -> None:
        kind, header_bytes, channel, speed, closure, _ = abi.CONTEXT.unpack(argument)
        if self._context is not None:
            raise Refused(errno.EBUSY)
        if kind != _RECEIVE or channel >= _CHANNELS or header_bytes not in {4, 8}:
            raise Refused(errno.EINVAL)

        def tell(cycle: int, headers: bytes) -> None:
            self._tell(abi.iso_interrupt(closure, cycle, headers))

        drops = self._version < abi.DROPS_HEADERS_BELOW
        self._context = ReceiveContext(channel, header_bytes, tell, drops_headers=drops)
        reply(self._connection, 0, abi.CONTEXT.pack(kind, header_bytes, channel, speed, closure, 0))

    def _queue(self, argument: bytes, packets: bytes) -> None:
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
        reply(self._connection, len(controls), abi.QUEUE.pack(0, end, 0, handle))

    def _start(self, argument: bytes) -> None:
        _, sync, tags, handle = abi.START.unpack(argument)
        context = self._known_context(handle)
        if not 0 < tags <= 0xF or sync > 0xF:
            raise Refused(errno.EINVAL)
        if tags & _IIDC_TAG:  # else none of the packets on this bus matches
            context.start(host_now())
        reply(self._connection, 0)

    def _known_context(self, handle: int) -> ReceiveContext:
        if self._context is None or handle != 0:
            raise Refused(errno.EINVAL)
        return self._context
