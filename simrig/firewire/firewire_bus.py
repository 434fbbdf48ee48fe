"""The emulated bus as a whole: its nodes, its trigger line, and the files that programs have open."""

import errno
import os
import socket
from collections.abc import Mapping
from typing import Final

from rig.clocks import HostNs, host_now
from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.firewire.bus_state import BusState
from simrig.firewire.camera.config_rom import HOST_VENDOR, host_rom
from simrig.firewire.camera.marlin import Camera
from simrig.firewire.host import abi, wire
from simrig.firewire.host.open_file import OpenFile
from simrig.firewire.host.wire import Operation, Request
from simrig.firewire.isochronous import CHANNELS, CycleTimer, IsoResources, Transmission
from simrig.firewire.loop import Loop
from simrig.world.pulses import PulseTrain

_HOST_NODE: Final = "fw0"
_HOST_GUID: Final = HOST_VENDOR << 40 | 1
_READ_WRITE: Final = 0o660


class Bus:
    """An emulated bus with its cameras. Only the loop's thread calls its methods.

    Args:
        loop: calls it when something is due.
        train: pulses on the trigger line.
        timer: clock of the bus.
        permitted: whether programs may open the nodes.
        cable: whether the trigger line is connected to the cameras.

    Attributes:
        generation: number of the bus's configuration; every reset makes a new one.
    """

    def __init__(self, loop: Loop, train: PulseTrain, timer: CycleTimer, *, permitted: bool, cable: bool) -> None:
        self._cable = cable
        self._loop, self._train, self.timer, self._permitted = loop, train, timer, permitted
        self.resources = IsoResources()
        self.generation = 1
        self._cameras: Mapping[str, Camera] = {}
        self._nodes: dict[str, Camera | None] = {_HOST_NODE: None}
        self._files: list[OpenFile] = []
        self._strangers: list[socket.socket] = []  # connections that have not sent their first request

    def connect(self, cameras: Mapping[str, Camera]) -> None:
        """Plug in the cameras, by name, in their order; from now on they see the pulses of the line."""
        self._cameras = cameras
        for index, camera in enumerate(cameras.values(), 1):
            self._nodes[f"fw{index}"] = camera
        if self._cable:
            self._await_pulse(host_now())

    def listen(self, server: socket.socket) -> None:
        """Accept connections of programs."""
        self._loop.when_readable(server, lambda: self._admit(server))

    def close(self) -> None:
        """Close all files and connections."""
        for file in self._files:
            file.close()
        for connection in self._strangers:
            connection.close()

    def send(self, frame: Transmission) -> None:
        """Deliver a frame that a camera sent."""
        for file in self._files:
            file.receive(frame)

    def reset(self) -> None:
        """Reset the bus: requests under the old generation fail from now on."""
        self.generation += 1
        for file in self._files:
            file.tell_reset()

    def unplug(self, name: str) -> None:
        """Take a camera off the bus, and its power away; does nothing if it is off.

        Raises:
            BadInputError: the bus has none of that name.
        """
        camera = self.camera(name)
        if not camera.plugged:
            return
        camera.plugged = False
        camera.power_up()
        node = self._node_of(camera)
        del self._nodes[node]
        for file in [file for file in self._files if file.node == node]:
            file.unplug()
        self.reset()

    def plug(self, name: str) -> None:
        """Put a camera on the bus, with default settings; it gets the lowest free node name.

        Raises:
            BadInputError: the bus has none of that name.
        """
        camera = self.camera(name)
        self.unplug(name)
        camera.plugged, camera.frozen = True, False
        camera.power_up()
        number = next(n for n in range(1, len(self._cameras) + 1) if f"fw{n}" not in self._nodes)
        self._nodes[f"fw{number}"] = camera
        self.reset()

    def camera(self, name: str) -> Camera:
        """A camera by its name.

        Raises:
            BadInputError: the bus has none of that name.
        """
        if name not in self._cameras:
            raise BadInputError(f'no camera "{name}" on this bus; name one of {", ".join(self._cameras)}')
        return self._cameras[name]

    def rom(self, node: str) -> tuple[int, ...]:
        """Configuration ROM of a node."""
        camera = self._nodes[node]
        return host_rom(_HOST_GUID) if camera is None else camera.rom

    def reset_event(self, node: str, closure: int) -> bytes:
        """The event of the last bus reset for a file of this node."""
        cameras = [name for name in self._nodes if name != _HOST_NODE]
        physical = cameras.index(node) if node in cameras else len(cameras)
        return abi.bus_reset(closure, physical, len(self._nodes), self.generation)

    def plugged_cameras(self) -> list[Camera]:
        """All cameras on the bus."""
        return [camera for camera in self._nodes.values() if camera is not None]

    def controls(self, camera: Camera) -> bool:
        """Whether a program receives from a camera."""
        return any(file.receiving for file in self._files if self._nodes.get(file.node) is camera)

    def state(self) -> BusState:
        """The state of the bus as a whole."""
        taken = tuple(channel for channel in range(CHANNELS) if self.resources.taken >> channel & 1)
        return BusState(self.generation, self.resources.bandwidth, taken, tuple(self._nodes))

    def closed(self, file: OpenFile) -> None:
        """Forget a file that its program closed."""
        self._files.remove(file)

    def _node_of(self, camera: Camera) -> str:
        return next(node for node, there in self._nodes.items() if there is camera)

    def _await_pulse(self, after: HostNs) -> None:
        pulse = self._train.next_index(after)
        time = self._train.time(pulse)
        self._loop.at(time, lambda: self._fire(pulse, time))

    def _fire(self, pulse: HillPulse, time: HostNs) -> None:
        for camera in self._cameras.values():
            camera.pulse(pulse, time)
        self._await_pulse(time)

    def _admit(self, server: socket.socket) -> None:
        connection, _ = server.accept()
        if wire.owner(connection) not in {os.getuid(), 0}:
            connection.close()
            return
        self._strangers.append(connection)
        self._loop.when_readable(connection, lambda: self._welcome(connection))

    def _welcome(self, connection: socket.socket) -> None:
        """Serve the first request of a connection: a list of the nodes, or the opening of a file."""
        request = wire.receive(connection)
        if request is not None and request.operation is Operation.LIST:
            names = b"".join(node.encode() + b"\0" for node in self._nodes)
            wire.reply(connection, _READ_WRITE if self._permitted else 0, b"", names)
            return
        self._strangers.remove(connection)
        self._loop.when_readable(connection, None)
        if request is None or request.operation is not Operation.OPEN:
            connection.close()
        else:
            self._open(connection, request)

    def _open(self, connection: socket.socket, request: Request) -> None:
        events = socket.socket(fileno=request.descriptor)
        node = request.extra.decode("ascii", "replace")
        if node not in self._nodes or not self._permitted:
            wire.reply(connection, -(errno.EACCES if node in self._nodes else errno.ENOENT))
            connection.close()
            events.close()
            return
        self._files.append(OpenFile(self, node, self._nodes[node], self._loop, connection, events))
        wire.reply(connection, 0)
