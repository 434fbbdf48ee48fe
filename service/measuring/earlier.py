"""What was measured before of the same athlete: the results of his other logs in the folder of recordings."""

from pathlib import Path

from analysis.report.kinogram.earlier import NAME, EarlierJump, read_earlier
from recorder.log.measured_path import measured_path
from recorder.log.session_changes import session_changes
from rig.api.athletes import folded
from rig.errors import BadInputError


def earlier_jumps(log: Path, athlete: str) -> list[EarlierJump]:
    """The measured jumps of an athlete in the other logs of a log's folder; none without a name.

    Whose jump it is says the session as it is now: a name that was corrected after the measuring counts. Logs in the
    trash do not, nor results that cannot be read.

    Args:
        log: the log that is being measured.
        athlete: who jumped in it.
    """
    wanted = folded(athlete)
    found: list[EarlierJump] = []
    if not wanted:
        return found
    for other in sorted(log.parent.glob("*.mcap")):
        path = measured_path(other) / NAME
        if other == log or not path.exists():
            continue
        try:
            changed = session_changes(other).get("athlete")
            jumps = read_earlier(path)
        except BadInputError:
            continue  # what is broken beside another log must not hinder the measuring of this one
        found += [jump for jump in jumps if folded(jump.athlete if changed is None else changed) == wanted]
    return found
