"""`python -m svev` is the same as `svev`."""

import sys

from svev.cli import main

sys.exit(main())
