"""One recording with a running rig: where the log goes, warm-up, progress, Ctrl-C, the result."""

import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from rig.control import Message
from rig.errors import BadInputError
from rig.settings import RigSettings
from svev import console
from svev.room import bytes_per_s, usable_bytes
from svev.running_rig import RunningRig


def new_log_path(directory: Path) -> Path:
    """A path for a new log in `directory`, which is made if missing; named by the time, UTC.

    Raises:
        BadInputError: the directory cannot be made or written.
    """
    name = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%SZ")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        probe = directory / f".{name}.probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise BadInputError(
            f"{directory}: cannot be written ({error.strerror}); choose another --out or correct its permissions"
        ) from None
    path, again = directory / f"{name}.mcap", 1
    while path.exists():
        again += 1
        path = directory / f"{name}-{again}.mcap"
    return path


def check_room(directory: Path, rig: RigSettings, seconds: float) -> None:
    """Whether a recording fits on the disk, beside what is kept in reserve.

    Raises:
        BadInputError: it does not.
    """
    needed = bytes_per_s(rig) * seconds / 1e9
    room = usable_bytes(rig, shutil.disk_usage(directory).free) / 1e9
    if needed > room:
        raise BadInputError(
            f"{directory}: {seconds:g} s need {needed:.2f} GB, but there is room for {max(0.0, room):.2f} GB beside "
            f"the reserve of {rig.recorder.reserve_gb:g} GB: make room, record less long or choose another --out"
        )


def run_recording(
    running: RunningRig, rig: RigSettings, path: Path, seconds: float, *, allow_absent: bool, session: dict[str, str]
) -> Message:
    """Record once: wait until the rig is warm, record, wait for the end. Ctrl-C and SIGTERM end the recording early.

    Returns:
        The result in the form of the command line's contract, with `stopped_early`.

    Raises:
        SvevError: there is no room for it, a camera is not there, the disk failed, the recorder died.
    """
    check_room(path.parent, rig, seconds)
    running.wait_until_warm(rig.trigger.settle_s, allow_absent=allow_absent)
    pulses = max(1, round(seconds * rig.trigger.rate_hz))
    with _stop_signals() as stop, console.progress(f"recording {path.name}", pulses) as advance:
        running.start_recording(path, recording=path.stem, session=session, pulses=pulses, seconds=seconds)
        report = running.wait_until_finished(lambda message: advance(message["pulses"]), stop)
        early = stop()
    result: Message = {"log": str(path)}
    result |= {key: report[key] for key in ("pulses", "complete", "partial", "causes", "bytes", "unpublished")}
    return result | {"stopped_early": early}


@contextmanager
def _stop_signals() -> Iterator[Callable[[], bool]]:
    """Within, Ctrl-C and SIGTERM only set a flag, so that the log is finished properly."""
    caught: list[int] = []
    before = {
        number: signal.signal(number, lambda n, _: caught.append(n)) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield lambda: bool(caught)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
