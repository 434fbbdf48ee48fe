"""A process that writes preview images thousands of times a second, until its standard input ends.

python -m tests.rig.transport.hammering_process FD

Image number n is of one grey value, n % 251, its time is n, and its statuses go round with n. Between two images it
pauses for none to a few tenths of a millisecond: a reader that needs longer than that for a copy finds no whole one.
"""

import select
import sys

import numpy as np

from rig.clocks import HostNs
from rig.frame import FrameStatus
from rig.pulse import RigPulse
from rig.transport.preview import PreviewSlot

KINDS = tuple(FrameStatus)
_PAUSE_S = 2e-4


def _main(fd: int) -> None:
    slot = PreviewSlot(fd)
    slot.take_over(slot.shape)
    pixels = np.zeros(slot.shape, np.uint8)
    number = 0
    while not select.select([sys.stdin], [], [], number % 4 * _PAUSE_S)[0]:
        number += 1
        pixels.fill(number % 251)
        slot.write(
            RigPulse(number), HostNs(number), (KINDS[number % len(KINDS)],) * slot.cameras, pixels, HostNs(number)
        )
        if number == 1:
            print("first", flush=True)  # noqa: T201
    print(number, flush=True)  # noqa: T201
    slot.close()


if __name__ == "__main__":
    _main(int(sys.argv[1]))
