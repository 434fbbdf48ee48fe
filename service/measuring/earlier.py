"""What was measured before of the same athlete, read from the results of his other logs."""

from collections.abc import Iterable
from pathlib import Path

from analysis.report.kinogram.earlier import EarlierJump, read_earlier
from rig.errors import BadInputError


def earlier_jumps(files: Iterable[str]) -> list[EarlierJump]:
    """The jumps of `kinogram.json` files; what cannot be read is left out.

    Args:
        files: whose they are, `service.recordings.measured_jumps` says.
    """
    found: list[EarlierJump] = []
    for file in files:
        try:
            found += read_earlier(Path(file))
        except BadInputError:
            continue  # what is broken beside another log must not hinder the measuring of this one
    return found
