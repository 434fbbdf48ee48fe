"""The program that makes one export: started by `service.exports.jobs`, told by lines of JSON, tells by lines of JSON.

It gets only what processor time nobody else wants, and stands still while it is told to.
"""

import json
import os
import sys
import threading
import time
import zipfile
from pathlib import Path
from typing import Any, Final

from rig.api.export import ExportOrder
from rig.errors import SvevError

_NICE: Final = 19
#: Between two lines that say how far it is.
_TELL_S: Final = 0.1


def main() -> None:
    """Make the export that the first line of standard input asks for.

    Every further line is "pause" or "go"; the end of standard input, which is also that of the service, ends it.
    """
    os.nice(_NICE)
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    asked = json.loads(sys.stdin.readline())
    going = threading.Event()
    going.set()
    threading.Thread(target=_obey, args=(going,), daemon=True).start()
    try:
        tell = _Teller(going)
        out = Path(asked["out"])
        _export(Path(asked["log"]), ExportOrder.model_validate(asked["order"]), out, tell)
        _say({"bytes": out.stat().st_size})
    except (SvevError, OSError) as error:
        _say({"problem": str(error)})


class _Teller:
    """Says how far the export is, and holds it while it has to stand still."""

    def __init__(self, going: threading.Event) -> None:
        self._going, self._told = going, 0.0

    def __call__(self, done: int, pulses: int) -> None:
        self._going.wait()
        if done == pulses or time.monotonic() - self._told > _TELL_S:
            self._told = time.monotonic()
            _say({"done": done, "pulses": pulses})


def _export(log: Path, order: ExportOrder, out: Path, tell: _Teller) -> None:
    from analysis.film.export import export  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.film.whole import whole_file  # noqa: PLC0415

    if out.suffix != ".zip":
        export(log, order, out, tell)
        return
    folder = out.with_suffix("")
    export(log, order, folder, tell)
    with whole_file(out) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for file in sorted(folder.rglob("*.*")):
            archive.write(file, file.relative_to(folder.parent))
            file.unlink()  # so that the pictures never need their room twice


def _obey(going: threading.Event) -> None:
    for line in sys.stdin:
        if line.strip() == "pause":
            going.clear()
        else:
            going.set()
    os._exit(1)


def _say(what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
