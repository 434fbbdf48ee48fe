"""Started by test_child: has `computing_program` stand still as soon as it works, and lives until it is killed."""

import sys

from rig.background.child import run_child
from tests.rig.background.computing_program import Begun, Compute, Computed

working: list[int] = []


def _tell(news: Begun) -> None:
    working.append(news.pid)
    sys.stdout.write(f"{news.pid}\n")
    sys.stdout.flush()


run_child(
    "tests.rig.background.computing_program",
    Compute(long=True),
    Begun | Computed,
    busy=lambda: bool(working),
    wanted=lambda: True,
    tell=_tell,
    yielding=False,
)
