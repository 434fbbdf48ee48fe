"""Makes `python -m svev` the same as `svev`."""

import sys

from svev.cli import main

sys.exit(main())
