"""A child for tests: reports its configuration, then waits to be told to quit (or does not listen)."""

import select
import threading

from svev.child import begin


def main() -> None:
    """Run as the process table runs its rows."""
    child = begin(5.0)
    child.control.send({"report": "config", **child.config})
    if child.config.get("deaf"):
        threading.Event().wait(60)
    while not child.stopping():
        select.select([child.control], [], [], 0.1)


if __name__ == "__main__":
    main()
