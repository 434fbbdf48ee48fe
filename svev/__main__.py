"""Makes `python -m svev` the same as `svev`."""

import sys

from svev.cli import main

if __name__ == "__main__":
    sys.exit(main())
