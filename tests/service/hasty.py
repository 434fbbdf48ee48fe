"""`svev` with shorter times against second taps: a training of forty jumps would take ten minutes otherwise."""

import sys

from service.supervision import tap_guard

HOLD_S, CONFIRM_S = 1.0, 1.5

if __name__ == "__main__":
    for name, seconds in (("HOLD_S", HOLD_S), ("CONFIRM_S", CONFIRM_S)):
        setattr(tap_guard, name, seconds)
    from svev.cli import main  # what it imports takes the times over

    sys.exit(main())
