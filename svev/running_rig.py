"""The running rig: rings, one grabber process per camera, one recorder process, and the simulated hill if asked for.

```
with RunningRig(rig, rig_toml) as running:
    running.wait_until_warm()
    running.start_recording(path, ...)
    result = running.wait_until_finished(on_progress)
```
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from recorder.assembler import CameraState
from rig.clocks import HostNs, host_now
from rig.control import Message
from rig.errors import (
    BadInputError,
    CameraError,
    CameraNotFoundError,
    LogDamagedError,
    ProcessDiedError,
    StorageError,
    SvevError,
)
from rig.ring import MAX_SLOTS, CameraRing
from rig.settings import RigSettings
from svev.backends import check_backends
from svev.process_table import Child, ProcessSpec, ProcessTable

_START_S: Final = 20.0
_RESTART_S: Final = 1.0
_LEAST_SLOTS: Final = 16
_ERRORS: Final[Mapping[str, type[SvevError]]] = {
    kind.__name__: kind for kind in (BadInputError, CameraError, LogDamagedError, StorageError)
}
RECORDER: Final = "recorder"


class RunningRig:
    """All processes of one rig; a context manager that stops them whatever happens.

    Args:
        rig: the rig.
        rig_toml: the rig file's text, attached to every log.
        on_event: is told, in one line, of cameras that come and go and of processes that are started again.
        epoch: host time of the simulated hill's pulse 0; now if left out.

    Raises:
        BadInputError: a camera's back end is not built yet.
    """

    def __init__(
        self, rig: RigSettings, rig_toml: str, on_event: Callable[[str], None], epoch: HostNs | None = None
    ) -> None:
        check_backends(rig)
        self._rig, self._rig_toml, self._on_event = rig, rig_toml, on_event
        self._processes = ProcessTable()
        self._exit = ExitStack()
        self._rings: list[CameraRing] = []
        self._doorbell = -1
        self._epoch = host_now() if epoch is None else epoch
        self._present = [False] * len(rig.cameras)
        self._reasons = [""] * len(rig.cameras)
        self._warm = False
        self._mourned: list[Child] = []
        self._path: Path | None = None
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
        names = [camera.name for camera in self._rig.cameras] + [RECORDER]
        return {name: self._processes[name].pid for name in names}

    def wait_until_warm(self, settle_s: float, *, allow_absent: bool) -> None:
        """Wait until all cameras have delivered a few whole triplets together.

        Raises:
            CameraNotFoundError: a camera does not answer in time.
            CameraError: all cameras are there, but no whole triplet came.
        """
        began = time.monotonic()
        complete_since = began
        while not self._warm:
            for _ in self._reports(0.1):
                pass
            now = time.monotonic()
            if all(self._present):
                if now > complete_since + settle_s:
                    raise CameraError(
                        f"all cameras are ready, but no complete triplet came within {settle_s:g} s: "
                        "check the pulse generator, the trigger cables and trigger.rate_hz in the rig file"
                    )
                continue
            complete_since = now
            # A camera that has failed to answer gets `settle_s`; one whose process is still starting gets longer.
            tried = all(present or reason for present, reason in zip(self._present, self._reasons, strict=True))
            if now > began + (settle_s if tried else _START_S):
                if allow_absent and any(self._present):
                    return
                self._raise_absent()

    def start_recording(
        self,
        path: Path,
        *,
        recording: str,
        session: Mapping[str, str],
        pulses: int | None = None,
        seconds: float | None = None,
    ) -> None:
        """Start a recording; it ends after `pulses`, after `seconds`, or by `stop_recording`.

        Raises:
            SvevError: the log cannot be created.
        """
        self._path = path
        command = {
            "command": "start", "path": str(path), "recording": recording, "session": dict(session),
            "pulses": pulses, "seconds": seconds, "rig_toml": self._rig_toml,
        }  # fmt: skip
        self._processes[RECORDER].control.send(command)
        deadline = time.monotonic() + _START_S
        while time.monotonic() < deadline:
            if any(message["report"] == "started" for message in self._reports(0.1)):
                return
        raise ProcessDiedError("the recorder process does not answer: start again, and if it recurs run: svev doctor")

    def stop_recording(self) -> None:
        """End the recording with the pulses that have fired until now."""
        self._processes[RECORDER].control.send({"command": "stop"})

    def wait_until_finished(self, on_progress: Callable[[Message], None], stop: Callable[[], bool]) -> Message:
        """Wait for the end of the recording.

        Args:
            on_progress: is told the counts so far.
            stop: asked several times a second whether to end the recording now.

        Returns:
            The recorder's report: path, bytes, pulses, complete, partial, causes.

        Raises:
            StorageError: the log could not be written to the end; what was written is readable.
            ProcessDiedError: the recorder died; what was written is readable.
        """
        told = False
        while True:
            if not told and stop():
                told = True
                self.stop_recording()
            for message in self._reports(0.2):
                if message["report"] == "finished":
                    return message
                if message["report"] == "progress":
                    on_progress(message)

    def _reports(self, timeout_s: float) -> Iterator[Message]:
        """Reports of the recorder; keeps the processes going on the side."""
        for _, message in self._processes.receive(timeout_s):
            match message["report"]:
                case "failed":
                    raise _ERRORS.get(message["kind"], SvevError)(message["message"])
                case "camera":
                    self._note_camera(message)
                case "warm":
                    self._warm = True
                case "health":
                    self.health = message
            yield message
        self._tend_processes()

    def _note_camera(self, message: Message) -> None:
        index, state, text = message["camera"], message["state"], message["text"]
        if state != CameraState.SILENT:
            self._present[index], self._reasons[index] = state == CameraState.CONNECTED, text
        self._on_event(f"{self._rig.cameras[index].name} {state}: {text}")

    def _tend_processes(self) -> None:
        """Start dead grabbers again, each at most once a second; a dead recorder ends everything."""
        names = [camera.name for camera in self._rig.cameras]
        for child in self._processes.dead():
            name, ending = child.spec.name, child.ending()
            if name == RECORDER:
                kept = f"; the log until then is readable: svev verify {self._path}" if self._path else ""
                raise ProcessDiedError(f"the recorder process ended ({ending}){kept}; then start again")
            index = names.index(name)
            if child not in self._mourned:
                self._mourned.append(child)
                self._on_event(f"the grabber process of {name} ended ({ending}); starting it again")
                reason = f"grabber process ended ({ending})"
                self._processes[RECORDER].control.send({"command": "camera_gone", "camera": index, "reason": reason})
            if time.monotonic() >= child.started + _RESTART_S:
                self._mourned.remove(child)
                self._start_grabber(index)

    def _raise_absent(self) -> None:
        reasons = "; ".join(
            reason or f"camera {camera.name} at {camera.address} does not answer: check power, cable and address"
            for camera, present, reason in zip(self._rig.cameras, self._present, self._reasons, strict=True)
            if not present
        )
        raise CameraNotFoundError(reasons)

    def _slots(self) -> int:
        wanted = round(self._rig.recorder.ring_s * self._rig.trigger.rate_hz)
        return min(MAX_SLOTS, max(_LEAST_SLOTS, wanted))

    def _start_recorder(self) -> None:
        fds = [ring.fd for ring in self._rings]
        config: dict[str, Any] = {"rig": self._rig.model_dump(mode="json"), "rings": fds, "doorbell": self._doorbell}
        self._processes.start(ProcessSpec(RECORDER, "svev.recorder_process", config, (*fds, self._doorbell)))

    def _start_grabber(self, index: int) -> None:
        ring = self._rings[index].fd
        config = {
            "rig": self._rig.model_dump(mode="json"), "camera": index, "ring": ring, "doorbell": self._doorbell,
            "epoch": self._epoch,
        }  # fmt: skip
        spec = ProcessSpec(self._rig.cameras[index].name, "svev.grabber_process", config, (ring, self._doorbell))
        self._processes.start(spec)
