"""Where `svev` starts, as the installed command and as `python -m svev`.

Users have files of our names, `service.py` for instance. Python looks in the present folder first after `python -m`,
and where PYTHONPATH has an empty entry, as after `export PYTHONPATH=$PYTHONPATH:/opt/other`.
"""

import os
import sys
from contextlib import suppress


def main() -> int:
    """Run the command line; the present folder is the last place where modules are looked for, unless it is named."""
    with suppress(FileNotFoundError):  # the folder was removed
        present = os.getcwd()  # noqa: PTH109 - as it stands in sys.path
        if present not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
            sys.path.sort(key=lambda place: place == present)
    from svev import cli  # noqa: PLC0415 - the places where it is looked for come first

    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
