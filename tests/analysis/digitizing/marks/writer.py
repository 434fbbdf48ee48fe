"""A program that marks without end, and prints the number of each action that is kept: `writer FOLDER`."""

import sys
from pathlib import Path

from analysis.digitizing.marks.journal import SUFFIX, Journal
from analysis.digitizing.marks.session import Session
from rig.api.digitizing import PlaceAction


def main() -> None:
    """Mark."""
    session = Session(Journal(Path(sys.argv[1]) / f"Anna{SUFFIX}", "jump-1", "Anna"))
    for number in range(session.revision, 10**9):
        session.act(PlaceAction(do="place", pulse=number, camera="K1", thing="P1", xy=(number % 640, 1.0)))
        print(number, flush=True)  # noqa: T201 - read by the test


if __name__ == "__main__":
    main()
