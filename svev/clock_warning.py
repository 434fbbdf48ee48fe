"""Says aside that the computer's date may be wrong, before it is written into a file."""

from collections.abc import Iterable
from pathlib import Path

from rig.host.clock_doubt import SET_THE_CLOCK, clock_doubt
from svev import console


def warn_of_clock(files: Iterable[Path]) -> str:
    """Say what speaks against the date, if anything does.

    Args:
        files: that were written before now.

    Returns:
        What speaks against it; empty: nothing does.
    """
    doubt = clock_doubt(files)
    if doubt is None:
        return ""
    console.say(f"warning: {doubt}; {SET_THE_CLOCK}", aside=True)
    return doubt.text
