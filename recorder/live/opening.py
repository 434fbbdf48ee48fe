"""Opens the log of a recording, and removes one that nobody needs, without waiting for the disk."""

import threading
from concurrent.futures import Future, wait
from dataclasses import replace
from pathlib import Path

from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.append_file import storage_error
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import NS_PER_S, HostNs
from rig.errors import StorageError
from rig.host.utc_clock import utc_fields
from rig.phrase import phrase


class OpeningLog:
    """A log that is opened in a thread of its own, which never keeps the process alive: the disk may hang for ever.

    Args:
        path: of the log.
        description: what it says before its first message.
        buffers: hold the triplets.
        now: present time.

    Attributes:
        path: as given.
        log: writes the log; None until `opened` has found it open.
    """

    def __init__(self, path: Path, description: LogDescription, buffers: TripletBuffers, now: HostNs) -> None:
        self.path = path
        self.log: LogWriter | None = None
        self._since = now
        self._future: Future[LogWriter] = Future()

        def run() -> None:
            try:
                self._future.set_result(_made(path, description, buffers))
            except BaseException as error:  # noqa: BLE001 - raised where the result is asked for
                self._future.set_exception(error)

        threading.Thread(target=run, name="opens a log", daemon=True).start()

    def opened(self) -> bool:
        """Whether the log is open by now.

        Raises:
            SvevError: it cannot be made.
        """
        if self.log is None and self._future.done():
            self.log = self._future.result()
        return self.log is not None

    def takes_s(self, now: HostNs) -> float:
        """For how long it has been being opened, s."""
        return (now - self._since) / NS_PER_S

    def give_up(self, error: StorageError) -> None:
        """Do not wait for the disk any longer; a log that is opened only now is removed again."""
        if self.log is None:
            self._future.add_done_callback(lambda _: self._remove(error))
        else:
            self.log.give_up(error)

    def discard(self) -> threading.Thread:
        """Remove a log without a pulse, open or not; the returned thread ends when it is removed."""

        def run() -> None:
            wait([self._future])
            self._remove(StorageError(f"{self.path}: no pulse came for this part"))

        thread = threading.Thread(target=run, name="removes a log", daemon=True)
        thread.start()
        return thread

    def unclosed(self) -> StorageError | None:
        """The error that the log has come to its end without being closed; None if it is closed."""
        if self.log is None or ((summary := self.log.summary) is not None and summary.closed):
            return None
        text = "{path}: the disk did not take the end of the log; what is written so far stays readable: svev recover"
        return self.log.error or StorageError(phrase("why_not_closed", text, path=str(self.path)))

    def _remove(self, error: StorageError) -> None:
        if self._future.exception() is None:
            self._future.result().give_up(error)
            self.path.unlink(missing_ok=True)


def _made(path: Path, description: LogDescription, buffers: TripletBuffers) -> LogWriter:
    """Make a log, with what is known of UTC; its folder too, which may have been deleted meanwhile."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise storage_error(path, error) from error
    return LogWriter(path, replace(description, rig={**description.rig, **utc_fields()}), buffers)
