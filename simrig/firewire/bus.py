"""The bus: its nodes, its clock, its resources, the trigger line, and the files that programs have open."""

import errno
import os
import socket
from collections.abc import Mapping
from typing import Final

from rig.clocks import HostNs, host_now
from rig.errors import BadInputError
from simrig.camera_program import Message
from simrig.firewire import abi, wire
from simrig.firewire.camera import Camera
from simrig.firewire.config_rom import HOST_VENDOR, host_rom
from simrig.firewire.cycle_timer import CycleTimer
from simrig.firewire.iso_resources import CHANNELS, IsoResources
from simrig.firewire.loop import Loop
from simrig.firewire.open_file import OpenFile
from simrig.firewire.transmission import Transmission
from simrig.firewire.wire import Operation, Request
from simrig.pulse_train import PulseTrain

_HOST_NODE: Final = "fw0"
_HOST_GUID: Final = HOST_VENDOR << 40 | 1
_READ_WRITE: Final = 0o660


class Bus:
    """An emulated bus with its cameras; everything happens in the loop's thread.

    Args:
        loop: when things happen.
        train: pulses on the trigger line.
        timer: clock of the bus.
        permitted: whether programs may open the nodes.

    Attributes:
        generation: number of the bus's configuration; a reset makes a new one.
    """

    def __init__(self, loop: Loop, train: PulseTrain, timer: CycleTimer, *, permitted: bool) -> None:
        self._loop, self._train, self.timer, self._permitted = loop, train, timer, permitted
        self.resources = IsoResources()
        self.generation = 1
        self._cameras: Mapping[str, Camera] = {}
        self._nodes: dict[str, Camera | None] = {_HOST_NODE: None}
        self._files: list[OpenFile] = []
        self._strangers: list[socket.socket] = []  # connections that have not said yet what they want

    def connect(self, cameras: Mapping[str, Camera]) -> None:
        """Plug the cameras in, in their order; the bus comes up and the pulses begin.

        Args:
            cameras: by name.
        """
        self._cameras = cameras
        for index, camera in enumerate(cameras.values(), 1):
            self._nodes[f"fw{index}"] = camera
        self._await_pulse(host_now())

    def listen(self, server: socket.socket) -> None:
        """Let programs in."""
        self._loop.when_readable(server, lambda: self._admit(server))

    def close(self) -> None:
        """Let go of all programs."""
        for file in self._files:
            file.close()
        for connection in self._strangers:
            connection.close()

    # -- the wire

    def send(self, frame: Transmission) -> None:
        """A camera has sent a frame."""
        for file in self._files:
            file.receive(frame)

    def reset(self) -> None:
        """A new configuration of the same nodes; who asks a node by the old one is told so."""
        self.generation += 1
        for file in self._files:
            file.tell_reset()

    def unplug(self, name: str) -> None:
        """Take a camera off the bus and its power away; nothing happens if it is off.

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

    # -- what files ask

    def rom(self, node: str) -> tuple[int, ...]:
        """Configuration ROM of a node."""
        camera = self._nodes[node]
        return host_rom(_HOST_GUID) if camera is None else camera.rom

    def reset_event(self, node: str, closure: int) -> bytes:
        """The last bus reset, as the node's files are told of it."""
        cameras = [name for name in self._nodes if name != _HOST_NODE]
        physical = cameras.index(node) if node in cameras else len(cameras)
        return abi.bus_reset(closure, physical, len(self._nodes), self.generation)

    def plugged_cameras(self) -> list[Camera]:
        """All cameras on the bus."""
        return [camera for camera in self._nodes.values() if camera is not None]

    def controls(self, camera: Camera) -> bool:
        """Whether a program receives from a camera."""
        return any(file.receiving for file in self._files if self._nodes.get(file.node) is camera)

    def state(self) -> Message:
        """The bus as a whole, for `simrig.firewire.hill_bus.BusState`."""
        taken = [channel for channel in range(CHANNELS) if self.resources.taken >> channel & 1]
        free = self.resources.bandwidth
        return {"generation": self.generation, "bandwidth": free, "channels": taken, "nodes": list(self._nodes)}

    def closed(self, file: OpenFile) -> None:
        """A program has closed a file."""
        self._files.remove(file)

    def _node_of(self, camera: Camera) -> str:
        return next(node for node, there in self._nodes.items() if there is camera)

    # -- the trigger line

    def _await_pulse(self, after: HostNs) -> None:
        pulse = self._train.next_index(after)
        time = self._train.time(pulse)
        self._loop.at(time, lambda: self._fire(pulse, time))

    def _fire(self, pulse: int, time: HostNs) -> None:
        for camera in self._cameras.values():
            camera.pulse(pulse, time)
        self._await_pulse(time)

    # -- programs that come

    def _admit(self, server: socket.socket) -> None:
        connection, _ = server.accept()
        if wire.owner(connection) not in {os.getuid(), 0}:
            connection.close()
            return
        self._strangers.append(connection)
        self._loop.when_readable(connection, lambda: self._welcome(connection))

    def _welcome(self, connection: socket.socket) -> None:
        """The first request of a connection: it asks for the nodes, or it becomes an open file."""
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
