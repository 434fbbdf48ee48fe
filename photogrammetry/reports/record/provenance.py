"""Where a report comes from: when it was made, by which program, from which files."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from photogrammetry.reports.document import Section, Table
from photogrammetry.reports.result_file import result_text
from rig.host.files import open_to_read


@dataclass(frozen=True, slots=True)
class Provenance:
    """Origin of a report.

    Attributes:
        made: when.
        program: with its version.
        command: what was called, with the options that change the result.
        files: role, name and SHA-256 of each file.
        doubt: what speaks against the date; empty: nothing does.
    """

    made: datetime
    program: str
    command: str
    files: tuple[tuple[str, str, str], ...]
    doubt: str = ""

    def with_result(self, result: Mapping[str, Any], path: Path) -> "Provenance":
        """With the result file too, which has this text once it is written."""
        digest = hashlib.sha256(result_text(result).encode("utf-8")).hexdigest()
        return replace(self, files=(*self.files, ("result", str(path), digest)))

    def section(self) -> Section:
        """The first section of the report."""
        made = self.made.isoformat(sep=" ", timespec="seconds")
        files = Table(("file", "name", "SHA-256"), self.files)
        doubt = (f"the date may be wrong: {self.doubt}",) if self.doubt else ()
        return Section("Origin", (f"made {made}, {self.program}", *doubt, self.command, files))


def provenance(command: str, files: Mapping[str, Path | None]) -> Provenance:
    """The origin of what is computed now.

    Args:
        command: what was called.
        files: by their role; None for a file that was not given.

    Raises:
        OSError: a file cannot be read.
    """
    read = [(role, str(path), _checksum(path)) for role, path in files.items() if path is not None]
    return Provenance(datetime.now(UTC), f"svev {version('svev')}", command, tuple(read))


def signature() -> Section:
    """The last section: who answers for it."""
    return Section(
        "Signature", ("Place and date: ______________________", "Name and signature: ______________________")
    )


def _checksum(path: Path) -> str:
    with open_to_read(path, links=True) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
