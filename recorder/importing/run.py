"""Makes a log of films: image sequences and videos of other cameras, tagged by frame number.

All films are read side by side, a frame of each at a time, so that memory does not grow with their length. The new log
is there under its name only when it is complete.
"""

import errno
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path

from recorder.importing.description import EPOCH, date_in_words, provenance, rig_toml
from recorder.importing.film_triplets import SESSION, FilmTriplets
from recorder.importing.films import ImportOrder, common_start, opened, pixels_of
from recorder.log.extent import extent
from recorder.log.mcap_layout import SlotLayout
from recorder.log.tag_room import check_tag_fits
from recorder.reading.info import imported_in_words
from recorder.recovering.rebuilt_log import RebuiltLog
from recorder.recovering.unfinished_log import unfinished_log
from recorder.writing.log_writer import LogDescription
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.events import Event, Level
from rig.phrase import escaped, plain
from rig.topics import EVENTS, IMPORT_METADATA, RECORDING_METADATA
from triggering.ledger.account import Ledger


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What was imported.

    Attributes:
        path: the log.
        bytes: its size.
        ledger: what became of every pulse.
        fields: what the log says of the films that it was made of.
        findings: what a person should know, one line each.
    """

    path: Path
    bytes: int
    ledger: Ledger
    fields: Mapping[str, str]
    findings: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """The report as one JSON object."""
        return {
            "log": str(self.path),
            **self.ledger.counts().model_dump(),
            "bytes": self.bytes,
            "imported": dict(self.fields),
            "findings": list(self.findings),
        }


class Import:
    """An import that is prepared: its films have been looked at.

    Raises:
        BadInputError: the log exists, something of the order does not fit together, or a film cannot be read.
    """

    def __init__(self, order: ImportOrder) -> None:
        if order.out.exists() and not order.replace:
            raise BadInputError(
                f"{order.out}: exists already; choose another name, or give --force to put the new log in its place"
            )
        if order.out.is_dir() or not order.out.parent.is_dir():
            raise BadInputError(f"{order.out}: cannot be made there; name a file in a folder that exists")
        self._order, self._cameras = order, opened(order)
        self._pixels = pixels_of(self._cameras)
        self._triplets = FilmTriplets(self._cameras, self._pixels, escaped(order.out.stem))
        names = [camera.name for camera in self._cameras]
        check_tag_fits(SlotLayout(self._triplets.shape, (), self._pixels), names, SESSION, escaped(order.out.stem))
        self._findings: list[str] = []
        self._read = 0

    @property
    def frames(self) -> int | None:
        """How many frames will be read, those of all cameras together, as the films say; None: one does not say."""
        expected = [camera.film.expected for camera in self._cameras]
        known = [each for each in expected if each is not None]
        return sum(known) * (1 + self._order.flash) if len(known) == len(expected) else None

    def run(self, progress: Callable[[int], None] = lambda _: None) -> ImportReport:
        """Write the log; for use once.

        Args:
            progress: called with the number of frames that have been read.

        Raises:
            BadInputError: a film is not as it should be; the message names the frame. Or memory does not suffice.
            StorageError: the disk refuses; nothing of the new log is left.
        """

        def read(frames: int = 1) -> None:
            self._read += frames
            progress(self._read)

        starts = common_start(self._cameras, self._order, read)
        with unfinished_log(self._order.out, replace=self._order.replace) as unfinished:
            try:
                return self._write(unfinished, starts, read)
            except (MemoryError, OSError) as error:
                if isinstance(error, OSError) and error.errno != errno.ENOMEM:
                    raise
                rows, columns = self._triplets.shape
                raise BadInputError(
                    f"there is not enough memory for some pictures of {columns} x {rows} px: close other programs, or "
                    "import fewer cameras"
                ) from None

    def _write(self, path: Path, starts: Mapping[str, int], read: Callable[[int], None]) -> ImportReport:
        order, ledger = self._order, Ledger()
        start, by = self._date(starts)
        common = self._common(date_in_words(start, by))
        begin = EPOCH if start is None else start
        films = [islice(camera.film.frames(starts[camera.name]), order.first - 1, None) for camera in self._cameras]
        with RebuiltLog(path, self._description(begin, common), self._triplets.shape, (), self._pixels) as log:
            _tell(log, begin, Level.WARNING, "import", imported_in_words(common))
            time = begin
            for place in count(order.first):
                if order.last is not None and place > order.last:
                    break
                taken = [next(film, None) for film in films]
                if all(frame is None for frame in taken):
                    break
                time = UtcNs(begin + round((place - 1) * NS_PER_S / order.rate_hz))
                for name, said in self._triplets.missing(taken):
                    self._findings.append(f"pulse {ledger.pulses + 1}: {name} {said}")
                    _tell(log, time, Level.WARNING, name, said)
                tag, picture = self._triplets.take(ledger.pulses + 1, time, taken)
                log.pulse(tag, picture, None)
                ledger.add(tag)
                read(sum(frame is not None for frame in taken))
            if ledger.first_time is None:
                raise BadInputError(f"no film has a frame for pulse {order.first} or later; correct --from and --to")
            for name, said in self._triplets.remarks():
                self._findings.append(f"{name}: {said}")
                _tell(log, time, Level.WARNING, name, said)
            fields = provenance(self._cameras, starts, self._triplets.used, common)
            metadata = {IMPORT_METADATA: fields, RECORDING_METADATA: extent(ledger.first_time, time)}
            size = log.close(metadata, Event.at(time, Level.INFO, "import", plain(f"{ledger.pulses} pulses imported")))
        return ImportReport(order.out, size, ledger, fields, tuple(self._findings))

    def _date(self, starts: Mapping[str, int]) -> tuple[UtcNs | None, str]:
        """When the common start was, UTC, and who says so; None: it is not known."""
        if self._order.date is not None:
            return self._order.date, "--date"
        for camera in self._cameras:
            if (date := camera.film.date) is not None:
                later_s = (starts[camera.name] - camera.film.first) / self._order.rate_hz
                return UtcNs(date + round(later_s * NS_PER_S)), camera.film.path.name
        return None, ""

    def _common(self, date: str) -> dict[str, str]:
        flash = self._order.flash
        return {
            "trigger": "none",
            "tagged_by": "frame number",
            "start": "flash" if flash else "frame number",
            "synchrony": "unknown, at the flash less than one frame" if flash else "unknown",
            "rate_hz": repr(self._order.rate_hz),
            "date": date,
        }

    def _description(self, begin: UtcNs, common: Mapping[str, str]) -> LogDescription:
        order, calibration = self._order, self._order.calibration
        names = [camera.name for camera in self._cameras]
        if order.rig is None:
            name, toml = SESSION, rig_toml(order.out, order.rate_hz, self._cameras, self._pixels)
        else:
            name, toml = order.rig[0].name, order.rig[1]
        rig = {
            "name": name,
            "cameras": ", ".join(names),
            "rate_hz": repr(order.rate_hz),
            "trigger": "none",
            "utc": "unknown",
            "utc_why": f"made of films; their date is {common['date']}",
        }
        return LogDescription(
            session={"session": SESSION, "recording": escaped(order.out.stem)},
            rig=rig,
            rig_toml=toml,
            calibration_json=None if calibration is None else calibration.json,
            calibrations={} if calibration is None else calibration.cameras,
            begin=begin,
        )


def _tell(log: RebuiltLog, time: UtcNs, level: Level, name: str, said: str) -> None:
    log.other(EVENTS.name, Event.at(time, level, name, plain(said)).to_protobuf(), time, time)
