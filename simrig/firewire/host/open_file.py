"""One open `/dev/fw*`: carries out ioctls and sends events as the kernel does (drivers/firewire/core-cdev.c)."""

import errno
import os
import socket
import struct
import time
from collections import deque
from typing import Final, Protocol

from rig.clocks import NS_PER_US, host_now
from simrig.firewire.camera.marlin import REGISTER_SPACE, Camera, Rcode, Tcode
from simrig.firewire.host import abi
from simrig.firewire.host.abi import Ioctl
from simrig.firewire.host.iso_file import IsoFile, Refused
from simrig.firewire.host.wire import Operation, Request, receive, reply
from simrig.firewire.isochronous import CycleTimer, IsoResources, Transmission
from simrig.firewire.loop import Loop

_ROM_END: Final = REGISTER_SPACE + 0x800  # the kernel refuses broadcasts to its own registers, below this
_MAX_REQUEST_BYTES: Final = 2048  # asynchronous packet at S400
_QUADLET: Final = 4
_CARD: Final = 0
_WRITES: Final = (Tcode.WRITE_QUADLET, Tcode.WRITE_BLOCK)
_CLOCK_TRIES: Final = 20
_CLOCK_GAP_NS: Final = 20_000


class Surroundings(Protocol):
    """What a file needs of the bus (`simrig.firewire.firewire_bus.Bus`)."""

    generation: int
    timer: CycleTimer
    resources: IsoResources

    def rom(self, node: str) -> tuple[int, ...]:
        """Configuration ROM of a node."""
        ...

    def reset_event(self, node: str, closure: int) -> bytes:
        """The event of the last bus reset for a file of this node."""
        ...

    def reset(self) -> None:
        """Reset the bus."""
        ...

    def plugged_cameras(self) -> list[Camera]:
        """All cameras on the bus."""
        ...

    def closed(self, file: "OpenFile") -> None:
        """Forget a file that its program closed."""
        ...


class OpenFile:
    """A file from open to close.

    Args:
        bus: the bus of its node.
        node: name of the node, e.g. fw1.
        camera: the camera at the node; None: the computer itself.
        loop: waits for its sockets.
        connection: brings its requests.
        events: our end of the socket that the program reads events from.
    """

    def __init__(
        self, bus: Surroundings, node: str, camera: Camera | None, loop: Loop, connection: socket.socket,
        events: socket.socket,
    ) -> None:  # fmt: skip
        self._bus, self.node, self._camera, self._loop = bus, node, camera, loop
        self._connection, self._events = connection, events
        self._events.setblocking(False)
        self._unsent: deque[bytes] = deque()
        self._version = 0  # until GET_INFO, for which libdc1394 never asks through the file that it captures with
        self._reset_closure = 0
        self._iso = IsoFile(bus.resources, self._tell)
        self._gone = False
        loop.when_readable(connection, self._serve)

    @property
    def receiving(self) -> bool:
        """Whether the file receives isochronous packets."""
        return self._iso.receiving

    def receive(self, frame: Transmission) -> None:
        """Receive a frame that was sent on the bus."""
        self._iso.receive(frame)

    def tell_reset(self) -> None:
        """Send the event of a bus reset."""
        self._tell(self._bus.reset_event(self.node, self._reset_closure))

    def unplug(self) -> None:
        """The node is gone: wake the program if it waits for events; everything else fails from now on."""
        self._gone = True
        self._iso.drop_context()
        self._loop.when_writable(self._events, None)
        self._events.close()

    def close(self) -> None:
        """Free what the file holds, and close its sockets."""
        self._iso.release()
        self._loop.when_readable(self._connection, None)
        self._loop.when_writable(self._events, None)
        self._connection.close()
        self._events.close()

    def _tell(self, event: bytes) -> None:
        """Queue an event. The queue is not bounded, as in the kernel: a program only gets events that it asked for."""
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
            self._unsent.clear()  # the program has begun to close the file
        self._loop.when_writable(self._events, None)

    def _serve(self) -> None:
        """Serve one request, or the end of the connection."""
        request = receive(self._connection)
        if request is None:
            self.close()
            self._bus.closed(self)
            return
        try:
            if self._gone:
                reply(self._connection, -errno.ENODEV)
            elif request.operation is Operation.MMAP:
                self._iso.map(request.argument, request.descriptor)
                reply(self._connection, 0)
            else:
                self._ioctl(request)
        except Refused as refusal:
            reply(self._connection, -refusal.number)
        except struct.error:  # the argument has another size than the kernel's
            reply(self._connection, -errno.EINVAL)
        finally:
            if request.descriptor >= 0:
                os.close(request.descriptor)

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
                answer, event = self._iso.allocate(argument)
                reply(self._connection, 0, answer)
                self._tell(event)
            case Ioctl.DEALLOCATE_ISO_RESOURCE:
                event = self._iso.deallocate(argument)
                reply(self._connection, 0)
                self._tell(event)
            case Ioctl.CREATE_ISO_CONTEXT:
                reply(self._connection, 0, self._iso.create_context(argument, self._version))
            case Ioctl.QUEUE_ISO:
                reply(self._connection, *self._iso.queue(argument, request.extra))
            case Ioctl.START_ISO:
                self._iso.start(argument)
                reply(self._connection, 0)
            case Ioctl.STOP_ISO:
                self._iso.stop(argument)
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
            self._tell(abi.response(closure, *self._camera.request(tcode, offset, length, data, host_now())))

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
        now = host_now()
        for camera in self._bus.plugged_cameras():
            camera.request(tcode, offset, length, data, now)
        self._tell(abi.response(closure, Rcode.COMPLETE, b""))  # no node acknowledges a broadcast

    def _cycle_time(self) -> tuple[int, int]:
        """UTC in us and the cycle timer, read almost at once (the kernel reads them with interrupts off)."""
        for _ in range(_CLOCK_TRIES):
            before = host_now()
            utc = time.time_ns()
            after = host_now()
            if after - before < _CLOCK_GAP_NS:
                break
        return utc // NS_PER_US, self._bus.timer.register(after)
