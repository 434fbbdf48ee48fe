"""The program that reads a log and its copy once more before the log is released, started by `releasing`."""

from pathlib import Path
from typing import Any

from rig.background.program import Teller, serve
from rig.errors import StorageError
from service.offloading.verified_copy import checksum, sum_of


def _confirm(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Compare `log`, `copy` and the checksum beside the copy; if they differ, the copy loses its checksum."""
    log, copy = Path(asked["log"]), Path(asked["copy"])
    wanted = sum_of(copy).read_text().partition(" ")[0]
    for path in (log, copy):
        if checksum(path, lambda count: tell(read=count)) != wanted:
            sum_of(copy).unlink()
            raise StorageError(
                f"{copy}: is not what was copied there any more; move it away, and the recording is copied again"
            )
    return {}


if __name__ == "__main__":
    serve(_confirm)
