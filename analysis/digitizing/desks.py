"""The logs that are measured by hand now, by the id of their recording.

The analysis and its libraries take memory and half a second to load: they are imported when the first log is opened.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from analysis.digitizing.files import DeskFiles

if TYPE_CHECKING:
    from analysis.cameras.source import Source
    from analysis.digitizing.desk import Desk

#: So many logs are open at once; each holds its static images and some frames.
_OPEN: Final = 3


class Desks:
    """Any thread may call any method.

    Args:
        find: gives the files of a recording.
        source: reads survey or poses; gives None if nobody named any.
        busy: whether the computer has something better to do, such as a recording: what takes seconds stands still
            then; None: nothing is recorded on this computer.
    """

    def __init__(
        self,
        find: Callable[[str], DeskFiles],
        source: "Callable[[], Source | None]",
        busy: Callable[[], bool] | None = None,
    ) -> None:
        self._find, self._source, self._busy = find, source, busy
        self._desks: OrderedDict[DeskFiles, Desk] = OrderedDict()
        self._lock = threading.Lock()

    def desk(self, recording: str) -> "Desk":
        """The desk of a recording, opened at the first call.

        Raises:
            UnknownRecordingError: there is no recording of this id.
            BadInputError: its log holds no pulse.
        """
        from analysis.digitizing.desk import Desk  # noqa: PLC0415

        files = self._find(recording)
        with self._lock:
            if files not in self._desks:
                self._desks[files] = Desk(files, self._source, self._busy)
                while len(self._desks) > _OPEN:
                    self._desks.popitem(last=False)[1].close()
            self._desks.move_to_end(files)
            return self._desks[files]

    def close(self) -> None:
        """Let other programs measure in these logs."""
        with self._lock:
            for desk in self._desks.values():
                desk.close()
            self._desks.clear()
