"""Where the images of logs stand, so that turning over the pulses of one reads its tags once."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.catalogue.file_key import FileKey, file_key
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import stored_triplets
from rig.pulse import PulseNumber

#: The places of the images of so many logs are kept.
_LOGS_MAX: Final = 4


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the images of a log stand: offset and length by pulse; `key`: of the file when it was read."""

    key: FileKey
    by_pulse: Mapping[PulseNumber, tuple[int, int]]


class ImagePlaces:
    """The places of the images in the logs that were looked at last. Reads one log at a time, whichever thread asks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._places: dict[Path, _Places] = {}

    def of(self, reader: LogReader, pulse: int) -> Mapping[PulseNumber, tuple[int, int]]:
        """Offset and length of an open log's image messages by pulse, that of `pulse` among them if there is one.

        Places in a log that has only grown since it was read are still true.

        Raises:
            BadInputError: the log cannot be read.
        """
        path = reader.path
        with self._lock:
            key, known = file_key(reader.status), self._places.pop(path, None)
            if known is None or (known.key != key and (known.key[0] != key[0] or pulse not in known.by_pulse)):
                by_pulse = {stored.tag.pulse: (stored.offset, stored.length) for stored in stored_triplets(reader)}
                known = _Places(key, by_pulse)
            self._places[path] = known  # the newest stands last
            if len(self._places) > _LOGS_MAX:
                del self._places[next(iter(self._places))]
            return known.by_pulse
