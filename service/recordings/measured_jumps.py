"""The measured jumps of all recordings of a folder, by athlete; results are read again only if they are others."""

import os
import threading
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from analysis.report.kinogram.earlier import NAME as KINOGRAM
from recorder.catalogue.entry import SUFFIX, Entry
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.index_file import FileKey, file_key
from recorder.log.jumper_path import jumper_path
from recorder.log.measured_path import measured_path
from rig.api.athletes import Athlete, AthleteJump, JumpQuery, folded
from rig.api.jump import LastJump
from rig.api.statement import Level
from service.measuring.outcome import outcome_path
from service.measuring.results import jumps_of
from service.recordings.live_results import summaries

#: What is repeated of a session field, however long the log has it.
_LONGEST_SHOWN: Final = 200


@dataclass(frozen=True, slots=True)
class _Known:
    """What was read beside a log, and of whom it was said to be then.

    Attributes:
        files: that of the whole log's result, and that of live results.
        keys: of these files.
        entry: the recording.
        jumps: its jumps.
    """

    files: tuple[str, str]
    keys: tuple[FileKey | None, FileKey | None]
    entry: Entry
    jumps: tuple[AthleteJump, ...]


class MeasuredJumps:
    """Any thread may call any method.

    Args:
        catalogue: of the folder of the recordings.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue, self._directory = catalogue, catalogue.directory
        self._known: dict[str, _Known] = {}
        self._lock = threading.Lock()

    def all(self) -> list[AthleteJump]:
        """The measured jumps of the recordings that lie in the folder itself, not in the trash, newest first.

        Raises:
            StorageError: the folder cannot be read.
        """
        jumps = [jump for each in self._look_at_all().values() for jump in each.jumps]
        return sorted(jumps, key=lambda each: (each.jump.time, each.jump.recording, each.jump.jump), reverse=True)

    def others_of_athlete(self, recording: str) -> list[Path]:
        """The `kinogram.json` of the other measured logs of whoever jumps in a recording; none without a name.

        Raises:
            StorageError: the folder cannot be read.
        """
        known = self._look_at_all()
        own = _athlete(known[recording].entry) if recording in known else ""
        return [
            measured_path(self._directory / f"{name}{SUFFIX}") / KINOGRAM
            for name, each in known.items()
            if own and name != recording and any(jump.level is not Level.INFO for jump in each.jumps)
            if _athlete(each.entry) == own
        ]

    def _look_at_all(self) -> dict[str, _Known]:
        with self._lock:
            self._known = {entry.id: self._look(entry) for entry in self._catalogue.entries()}
            return self._known

    def _look(self, entry: Entry) -> _Known:
        before, log = self._known.get(entry.id), self._directory / f"{entry.id}{SUFFIX}"
        files = before.files if before is not None else (str(outcome_path(log)), str(jumper_path(log)))
        keys = _key(files[0]), _key(files[1])
        if before is not None and before.keys == keys:
            if before.entry is entry:
                return before
            found = [(each.jump, each.level is Level.INFO) for each in before.jumps]
        else:
            whole = jumps_of(log) if keys[0] else ()
            live = summaries(log) if keys[1] and not whole else ()
            found = [*((jump, False) for jump in whole), *((jump, True) for jump in live)]
        return _Known(files, keys, entry, tuple(_of_athlete(entry, jump, live=live) for jump, live in found))


def wanted(jumps: Iterable[AthleteJump], query: JumpQuery) -> list[AthleteJump]:
    """Those of the jumps that a query asks for, in their order."""
    name = folded(query.athlete)
    fitting = [
        each
        for each in jumps
        if (not name or folded(each.athlete) == name)
        and (query.since is None or each.jump.time >= query.since)
        and (query.until is None or each.jump.time < query.until)
    ]
    return fitting[: query.limit]


def athletes(jumps: Iterable[AthleteJump]) -> list[Athlete]:
    """Whose jumps these are, by name; those without a name are nobody's.

    Args:
        jumps: newest first.
    """
    by_name: dict[str, list[AthleteJump]] = {}
    for each in jumps:
        by_name.setdefault(folded(each.athlete), []).append(each)
    by_name.pop("", None)
    return [
        Athlete(
            name=" ".join(own[0].athlete.split()),
            bib=own[0].bib,
            jumps=len(own),
            first=own[-1].jump.time,
            last=own[0].jump.time,
        )
        for _, own in sorted(by_name.items())
    ]


def _of_athlete(entry: Entry, jump: LastJump, *, live: bool) -> AthleteJump:
    session = {name: text[:_LONGEST_SHOWN].strip() for name, text in entry.session.items()}
    return AthleteJump(
        athlete=session.get("athlete", ""),
        bib=session.get("bib", ""),
        gate=session.get("gate", ""),
        level=Level.INFO if live else Level.GOOD if jump.ok else Level.WARNING,
        jump=jump.model_copy(update={"recording": entry.id}),
    )


def _athlete(entry: Entry) -> str:
    return folded(entry.session.get("athlete", ""))


def _key(path: str) -> FileKey | None:
    with suppress(OSError):
        return file_key(os.lstat(path))
    return None
