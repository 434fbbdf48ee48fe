"""The processes of one rig: rings, one grabber process per camera, one recorder process.

Turned by its owner, it never blocks for longer than asked: it passes on what the recorder reports, knows which camera
is there, and starts grabbers that died again. What a dead recorder means is for the owner to say.
"""

import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Final, Self

from recorder.assembler import CameraState
from recorder.events import Event, Level
from rig.clocks import HostNs, host_now
from rig.control import Message
from rig.errors import ProcessDiedError
from rig.ring import MAX_SLOTS, CameraRing
from rig.settings import RigSettings
from svev.back_off import BackOff
from svev.backends import check_backends
from svev.process_table import Child, ProcessSpec, ProcessTable

_LEAST_SLOTS: Final = 16
#: What changes a camera's presence, and how much it matters; anything else is only told.
_PRESENCE: Final = {
    CameraState.CONNECTED: Level.INFO,
    CameraState.SILENT: Level.WARNING,
    CameraState.GONE: Level.ERROR,
}
RECORDER: Final = "recorder"


@dataclass(frozen=True, slots=True)
class CameraPresence:
    """What was last heard of a camera.

    Attributes:
        state: None as long as nothing was heard.
        text: what it said of itself, or why it is not there.
        counted: so often frames were counted since it was called silent.
    """

    state: CameraState | None = None
    text: str = ""
    counted: int = 0

    @property
    def present(self) -> bool:
        """Whether it is connected; one that has fallen silent is, until its grabber has lost it."""
        return self.state in {CameraState.CONNECTED, CameraState.SILENT}

    @property
    def tried(self) -> bool:
        """Whether it has answered or failed to."""
        return self.state is not None


class RigProcesses:
    """All processes of one rig; a context manager that stops them whatever happens.

    Args:
        rig: the rig.
        on_event: is told of cameras that come and go and of processes that are started again.
        epoch: host time of the simulated hill's pulse 0; now if left out.
        recorder: more configuration for the recorder.
        inherit: descriptors that the recorder inherits for it.
        environment: what grabbers of FireWire cameras need in theirs, for simulated ones.

    Attributes:
        cameras: what was last heard of each.
        warm: whether whole triplets have come.
        ready: whether the recorder has reported for work.
        recorder_died: whether it is dead now; nothing is known of cameras then.
        health: the recorder's last report of that name.

    Raises:
        BadInputError: a camera's back end is not built yet.
    """

    def __init__(
        self,
        rig: RigSettings,
        on_event: Callable[[Event], None],
        *,
        epoch: HostNs | None = None,
        recorder: Mapping[str, Any] | None = None,
        inherit: tuple[int, ...] = (),
        environment: Mapping[str, str] | None = None,
    ) -> None:
        check_backends(rig)
        self._rig, self._on_event = rig, on_event
        self._more, self._inherit = dict(recorder or {}), inherit
        self._environment = dict(environment or {})
        self._processes = ProcessTable()
        self._exit = ExitStack()
        self._rings: list[CameraRing] = []
        self._doorbell = -1
        self._epoch = host_now() if epoch is None else epoch
        self._names = [camera.name for camera in rig.cameras]
        self._back_offs = {name: BackOff() for name in self._names}
        self._again: dict[Child, float] = {}
        self.cameras = [CameraPresence()] * len(rig.cameras)
        self.warm = self.ready = self.recorder_died = False
        self.health: Message = {}

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._doorbell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
            stack.callback(os.close, self._doorbell)
            for camera in self._rig.cameras:
                ring = CameraRing.create(camera.name, camera.frame_bytes, self._slots())
                stack.callback(ring.close)
                self._rings.append(ring)
            stack.callback(self._processes.stop)
            self._start_recorder()
            for index in range(len(self._rig.cameras)):
                self._start_grabber(index)
            self._exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._exit.close()

    @property
    def pids(self) -> dict[str, int]:
        """Process ids by row of the process table."""
        return {name: self._processes[name].pid for name in (*self._names, RECORDER)}

    @property
    def restarts(self) -> dict[str, int]:
        """How often each grabber was started again, by camera."""
        return {name: back_off.deaths for name, back_off in self._back_offs.items()}

    @property
    def started(self) -> float:
        """When the recorder was started, on the monotonic clock, s."""
        return self._processes[RECORDER].started

    def tell(self, command: Message, *, or_drop: bool = False) -> None:
        """Send a command to the recorder; if `or_drop`, not to one that does not read."""
        self._processes[RECORDER].control.send(command, or_drop=or_drop)

    def kill_recorder(self) -> None:
        """End a recorder that does not answer; the next turn tells its death."""
        self._processes[RECORDER].kill()

    def turn(self, timeout_s: float, wake: tuple[int, ...] = ()) -> list[Message]:
        """Pass on the recorder's reports, and keep the processes going on the side.

        Args:
            timeout_s: wait at most so long for the first report.
            wake: descriptors that end the waiting when they become readable.

        Raises:
            ProcessDiedError: the recorder died, and everything that it reported before has been passed on; said once.
        """
        reports = [message for _, message in self._processes.receive(timeout_s, wake)]
        for message in reports:
            match message["report"]:
                case "camera":
                    self._note_camera(message["camera"], CameraState(message["state"]), message["text"])
                case "warm":
                    self.warm = True
                case "ready":
                    self.ready = True
                case "health":
                    self.health = message
                    self._note_recovered(message)
        self._tend()
        return reports

    def restart_recorder(self) -> None:
        """Start a recorder in place of the dead one; cameras that kept on streaming are there again at once."""
        self.recorder_died = False
        self._start_recorder()

    def _note_camera(self, index: int, state: CameraState, text: str) -> None:
        if state in _PRESENCE:
            self.cameras[index] = CameraPresence(state, text)
        self._on_event(Event.now(_PRESENCE.get(state, Level.WARNING), self._names[index], f"{state}: {text}"))

    def _note_recovered(self, health: Message) -> None:
        """A camera that only seemed silent delivers on, and nobody says so: seen by its frames of a whole second."""
        for index, camera in enumerate(self.cameras):
            if camera.state is CameraState.SILENT:
                counted = camera.counted + 1 if health["cameras"][index]["frames_per_s"] else 0
                state = CameraState.CONNECTED if counted > 1 else CameraState.SILENT
                self.cameras[index] = CameraPresence(state, camera.text, counted)

    def _tend(self) -> None:
        """Start dead grabbers again, after a while that grows; a dead recorder ends everything."""
        for child in self._processes.dead():
            if child.spec.name != RECORDER:
                self._tend_grabber(child)
            elif child.control.ended and not self.recorder_died:
                self.recorder_died, self.ready, self.warm, self.health = True, False, False, {}
                self.cameras = [CameraPresence()] * len(self._names)
                raise ProcessDiedError(f"the recorder process ended ({child.ending()}): if it recurs, run svev doctor")

    def _tend_grabber(self, child: Child) -> None:
        name, now = child.spec.name, time.monotonic()
        if child not in self._again:
            reason = f"grabber process ended ({child.ending()})"
            wait_s = self._back_offs[name].died(now - child.started)
            self._again[child] = now + wait_s
            self._on_event(Event.now(Level.ERROR, name, f"{reason}; starting it again in {wait_s:g} s"))
            self.tell({"command": "camera_gone", "camera": self._names.index(name), "reason": reason})
        elif now >= self._again[child]:
            del self._again[child]
            self._start_grabber(self._names.index(name))

    def _slots(self) -> int:
        wanted = round(self._rig.recorder.ring_s * self._rig.trigger.rate_hz)
        return min(MAX_SLOTS, max(_LEAST_SLOTS, wanted))

    def _start_recorder(self) -> None:
        fds = [ring.fd for ring in self._rings]
        config = {
            "rig": self._rig.model_dump(mode="json", exclude_unset=True),
            "rings": fds,
            "doorbell": self._doorbell,
            **self._more,
        }
        inherit = (*fds, self._doorbell, *self._inherit)
        self._processes.start(ProcessSpec(RECORDER, "svev.recorder_process", config, inherit))

    def _start_grabber(self, index: int) -> None:
        ring = self._rings[index].fd
        config = {
            "rig": self._rig.model_dump(mode="json", exclude_unset=True), "camera": index, "ring": ring,
            "doorbell": self._doorbell, "epoch": self._epoch,
        }  # fmt: skip
        # Only libdc1394 has to see the emulated bus.
        more = self._environment if self._rig.cameras[index].backend == "iidc" else {}
        spec = ProcessSpec(self._names[index], "svev.grabber_process", config, (ring, self._doorbell), more)
        self._processes.start(spec)
