"""The part of the seam that is about exports of recordings."""

from pathlib import Path
from typing import Protocol

from rig.api.export import ExportJob


class Exports(Protocol):
    """Exports of recordings: one is made after the other, and none while a recording runs.

    Raises (each where it applies):
        UnknownExportError: there is none of this id.
        StateForbidsError: it is not done.
    """

    def jobs(self) -> list[ExportJob]:
        """All that are kept, newest first."""
        ...

    def job(self, job_id: str) -> ExportJob:
        """One of them."""
        ...

    def file(self, job_id: str) -> Path:
        """The file of one that is done."""
        ...

    def remove(self, job_id: str) -> ExportJob:
        """Remove one and its file; one that is not done is given up."""
        ...
