"""Prints the entries of a lock file that svev needs when it runs, with their hashes: locked.py FILE.

The lock file holds what development needs, too. Which packages are needed to run follows from what the installed
packages require, beginning with svev itself.
"""

import re
import sys
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name


def needed(requirement: Requirement, found: set[str]) -> None:
    """Add the names of a package and of all that it requires here to `found`."""
    name = canonicalize_name(requirement.name)
    extras = requirement.extras | {""}
    key = f"{name}[{','.join(sorted(extras))}]"
    if key in found:
        return
    found |= {name, key}
    for line in distribution(name).requires or ():
        further = Requirement(line)
        if further.marker is None or any(further.marker.evaluate({"extra": extra}) for extra in extras):
            needed(further, found)


def main() -> None:
    """Print the entries.

    Raises:
        SystemExit: a package is not in the lock file.
    """
    entries = {}
    for entry in re.split(r"^(?=[A-Za-z0-9._-]+==)", Path(sys.argv[1]).read_text(encoding="utf-8"), flags=re.MULTILINE):
        name, separator, _ = entry.partition("==")
        if separator:
            entries[canonicalize_name(name)] = entry
    found: set[str] = set()
    needed(Requirement("svev"), found)
    names = sorted(name for name in found if "[" not in name and name != "svev")
    if missing := [name for name in names if name not in entries]:
        sys.exit(f"requirements.lock lacks {', '.join(missing)}: run make lock")
    sys.stdout.writelines(entries[name] for name in names)


if __name__ == "__main__":
    main()
