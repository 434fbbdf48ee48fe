"""The program that writes a corrected name into a result, started by `service.measuring.after_steps`."""

from pathlib import Path
from typing import Any

from recorder.log.session_changes import session_changes
from rig.background.program import Teller, serve


def _rename(asked: dict[str, Any], _: Teller) -> dict[str, Any]:
    """Write those files of `result`, which was measured in `log`, into the folder `out` that say whose jump it is."""
    from analysis.procedure.renaming import write_renamed  # noqa: PLC0415 - its libraries start their threads with our low priority
    from service.measuring.earlier import earlier_jumps  # noqa: PLC0415

    log = Path(asked["log"])
    earlier = earlier_jumps(asked["earlier"])
    write_renamed(Path(asked["result"]), log, Path(asked["out"]), session_changes(log), earlier=earlier)
    return {}


if __name__ == "__main__":
    serve(_rename)
