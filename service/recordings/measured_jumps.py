"""The measured jumps of all recordings of a folder, and what the catalogue asks about each log."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from analysis.report.kinogram.earlier import NAME as KINOGRAM
from recorder.catalogue.entry import SUFFIX, Entry
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.log_index import FoundJump
from recorder.log.beside import measured_path
from rig.api.athletes import Athlete, AthleteJump, JumpQuery, folded
from rig.api.jump import LastJump
from rig.api.statement import Level
from rig.errors import UnknownRecordingError
from rig.transport import wire
from service.measuring.results import jumps_of
from service.recordings.live_results import summaries
from service.recordings.verdicts import verdict

#: What is repeated of a session field, however long the log has it.
_LONGEST_SHOWN: Final = 200
_SESSION: Final = wire.decoder(dict[str, str])


class LogJudge:
    """Tells the catalogue of the verdict on a log and of the jumps that were measured in it."""

    def level(self, entry: Entry) -> Level:
        """How grave the verdict is."""
        return verdict(entry).level

    def jumps(self, log: Path) -> Sequence[FoundJump]:
        """Those of the whole log; if it was not measured, those that were measured live."""
        whole = jumps_of(log)
        return [FoundJump(jump, live=not whole) for jump in whole or summaries(log)]


class MeasuredJumps:
    """Any thread may call any method.

    Args:
        catalogue: of the folder of the recordings, with a `LogJudge`.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue

    def find(self, query: JumpQuery) -> list[AthleteJump]:
        """The measured jumps that a query finds, newest first; none that lies in the trash.

        Raises:
            BadInputError: its text cannot be understood.
            StorageError: the folder cannot be read.
        """
        rows = self._catalogue.jumps(query, "r.id, r.said, j.live, j.content")
        return [
            _of_athlete(recording, _SESSION.decode(said), content, live=live) for recording, said, live, content in rows
        ]

    def others_of_athlete(self, recording: str) -> list[Path]:
        """The `kinogram.json` of the other measured logs of whoever jumps in a recording; none without a name.

        Raises:
            StorageError: the folder cannot be read.
        """
        try:
            name = folded(self._catalogue.entry(recording).session.get("athlete", ""))
        except UnknownRecordingError:  # removed meanwhile
            return []
        if not name:
            return []
        rows = self._catalogue.jumps(JumpQuery.model_construct(athlete=name), "r.id, j.live")
        others = dict.fromkeys(other for other, live in rows if not live and other != recording)
        folder = self._catalogue.directory
        return [measured_path(folder / f"{other}{SUFFIX}") / KINOGRAM for other in others]


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


def _of_athlete(recording: str, said: dict[str, str], content: bytes, *, live: bool) -> AthleteJump:
    jump = LastJump.model_validate_json(content)
    return AthleteJump(
        **{name: text[:_LONGEST_SHOWN].strip() for name, text in said.items()},
        level=Level.INFO if live else Level.GOOD if jump.ok else Level.WARNING,
        jump=jump.model_copy(update={"recording": recording}),
    )
