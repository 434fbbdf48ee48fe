"""Opens the log of a recording without waiting for the disk."""

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import replace
from pathlib import Path

from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.append_file import storage_error
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.errors import StorageError
from rig.host.utc_clock import utc_fields


def open_log(path: Path, description: LogDescription, buffers: TripletBuffers) -> LogWriter:
    """Make a log, with what is known of UTC; its folder too, which may have been deleted meanwhile."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise storage_error(path, error) from error
    return LogWriter(path, replace(description, rig={**description.rig, **utc_fields()}), buffers)


def in_background(make: Callable[[], LogWriter]) -> "Future[LogWriter]":
    """Call a function in a thread that never keeps the process alive: the disk may hang for ever."""
    future: Future[LogWriter] = Future()

    def run() -> None:
        try:
            future.set_result(make())
        except BaseException as error:  # noqa: BLE001 - raised where the result is asked for
            future.set_exception(error)

    threading.Thread(target=run, name="opens a log", daemon=True).start()
    return future


def discard_in_background(error: StorageError, opening: "Future[LogWriter]") -> threading.Thread:
    """Give up a log that nobody needs, whether it is open by now or not, and remove its file."""

    def run() -> None:
        wait([opening])
        discard(error, opening)

    thread = threading.Thread(target=run, name="removes a log", daemon=True)
    thread.start()
    return thread


def discard(error: StorageError, opening: "Future[LogWriter]") -> None:
    """Give up a log that was opened after nobody waited for it any more, and remove its file."""
    if opening.exception() is None:
        opening.result().give_up(error)
        opening.result().path.unlink(missing_ok=True)
