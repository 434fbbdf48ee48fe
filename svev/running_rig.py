"""The running rig as a command line sees it: wait until it is warm, record, wait for the end.

```
with RunningRig(rig, rig_toml, on_event) as running:
    running.wait_until_warm(settle_s, allow_absent=False)
    running.start_recording(path, ...)
    result = running.wait_until_finished(on_progress, stop)
```
"""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from recorder.events import Event
from rig.clocks import HostNs
from rig.control import Message
from rig.errors import BadInputError, CameraError, CameraNotFoundError, ProcessDiedError, StorageError, SvevError
from rig.settings import RigSettings
from svev.rig_processes import RigProcesses

_START_S: Final = 20.0
_ERRORS: Final[Mapping[str, type[SvevError]]] = {
    kind.__name__: kind for kind in (BadInputError, CameraError, StorageError)
}


def reported_error(report: Message) -> SvevError:
    """What a recorder's report `failed` means, as the error that it was."""
    return _ERRORS.get(report["kind"], SvevError)(report["message"])


class RunningRig:
    """All processes of one rig; a context manager that stops them whatever happens.

    Args:
        rig: the rig.
        rig_toml: the rig file's text, attached to every log.
        on_event: is told, in one line, of cameras that come and go and of processes that are started again.
        epoch: host time of the simulated hill's pulse 0; now if left out.
        environment: what grabbers of FireWire cameras need in theirs, for simulated ones.

    Raises:
        BadInputError: a camera's back end is not built yet.
    """

    def __init__(
        self,
        rig: RigSettings,
        rig_toml: str,
        on_event: Callable[[str], None],
        epoch: HostNs | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        def tell(event: Event) -> None:
            on_event(f"{event.name} {event.message}")

        self._rig, self._rig_toml = rig, rig_toml
        self._processes = RigProcesses(rig, tell, epoch=epoch, environment=environment)
        self._path: Path | None = None

    def __enter__(self) -> Self:
        self._processes.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._processes.__exit__(kind, error, trace)

    @property
    def pids(self) -> dict[str, int]:
        """Process ids by row of the process table."""
        return self._processes.pids

    @property
    def health(self) -> Message:
        """The recorder's last report of its health."""
        return self._processes.health

    def wait_until_warm(self, settle_s: float, *, allow_absent: bool) -> None:
        """Wait until all cameras have delivered a few whole triplets together.

        Raises:
            CameraNotFoundError: a camera does not answer in time.
            CameraError: all cameras are there, but no whole triplet came.
        """
        began = time.monotonic()
        complete_since = began
        while not self._processes.warm:
            self._reports(0.1)
            now = time.monotonic()
            cameras = self._processes.cameras
            if all(camera.present for camera in cameras):
                if now > complete_since + settle_s:
                    raise CameraError(
                        f"all cameras are ready, but no complete triplet came within {settle_s:g} s: "
                        "check the pulse generator, the trigger cables and trigger.rate_hz in the rig file"
                    )
                continue
            complete_since = now
            # A camera that has failed to answer gets `settle_s`; one whose process is still starting gets longer.
            if now > began + (settle_s if all(camera.tried for camera in cameras) else _START_S):
                if allow_absent and any(camera.present for camera in cameras):
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
        self._processes.tell(command)
        deadline = time.monotonic() + _START_S
        while time.monotonic() < deadline:
            if any(message["report"] == "started" for message in self._reports(0.1)):
                return
        raise ProcessDiedError("the recorder process does not answer: start again, and if it recurs run: svev doctor")

    def stop_recording(self) -> None:
        """End the recording with the pulses that have fired until now."""
        self._processes.tell({"command": "stop"})

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

    def _reports(self, timeout_s: float) -> list[Message]:
        """Reports of the recorder; a failure among them is raised."""
        try:
            reports = self._processes.turn(timeout_s)
        except ProcessDiedError as error:
            kept = f"; the log until then is readable: svev verify {self._path}" if self._path else ""
            raise ProcessDiedError(f"{error}{kept}; then start again") from None
        for message in reports:
            if message["report"] == "failed":
                raise reported_error(message)
        return reports

    def _raise_absent(self) -> None:
        reasons = "; ".join(
            heard.text or f"camera {camera.name} at {camera.address} does not answer: check power, cable and address"
            for camera, heard in zip(self._rig.cameras, self._processes.cameras, strict=True)
            if not heard.present
        )
        raise CameraNotFoundError(reasons)
