"""Started by test_child: has `computing_program` stand still as soon as it works, and lives until it is killed."""

import sys
from typing import Any

from rig.background.child import run_child

working: list[int] = []


def _tell(news: dict[str, Any]) -> None:
    working.append(news["pid"])
    sys.stdout.write(f"{news['pid']}\n")
    sys.stdout.flush()


run_child(
    "tests.rig.background.computing_program",
    {"long": True},
    busy=lambda: bool(working),
    wanted=lambda: True,
    tell=_tell,
    hold=lambda _: None,
    yielding=False,
)
