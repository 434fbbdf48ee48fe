"""A process that writes preview images as fast as it can, until its standard input ends.

python -m tests.rig.hammering_process FD

Image number n is of one grey value, n % 251, its time is n, and its statuses go round with n.
"""

import select
import sys

import numpy as np

from rig.clocks import HostNs
from rig.frame import FrameStatus
from rig.preview import PreviewSlot

KINDS = tuple(FrameStatus)


def _main(fd: int) -> None:
    slot = PreviewSlot(fd)
    slot.take_over()
    pixels = np.zeros(slot.shape, np.uint8)
    number = 0
    while not select.select([sys.stdin], [], [], 0)[0]:
        number += 1
        pixels.fill(number % 251)
        slot.write(number, HostNs(number), (KINDS[number % len(KINDS)],) * slot.cameras, pixels, HostNs(number))
        if number == 1:
            print("first", flush=True)  # noqa: T201
    print(number, flush=True)  # noqa: T201
    slot.close()


if __name__ == "__main__":
    _main(int(sys.argv[1]))
