"""A process that writes a log until it is killed, or until the disk takes no more.

python -m tests.recorder.writing.writing_process LOG [LARGEST FILE IN BYTES]

It prints a line per pulse: how many pulses have certainly left the writer's queue. After a storage error it prints
`error MESSAGE`, then `close MESSAGE` (or `closed`), and ends.
"""

import resource
import sys
from pathlib import Path

from recorder.log.triplet_buffers import TripletBuffers
from rig.errors import StorageError
from tests.recorder.logs import make_tag, open_writer, write_pulse

SHAPE = (240, 960)


def _main(path: Path, largest: int | None) -> None:
    if largest is not None:  # Python ignores SIGXFSZ, so that the write fails with EFBIG
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    buffers = TripletBuffers(SHAPE, 4)
    log = open_writer(path, buffers)
    pulse = 0
    try:
        while True:
            pulse += 1
            write_pulse(log, buffers, make_tag(pulse, shape=SHAPE))
            print(max(0, pulse - buffers.count), flush=True)  # noqa: T201
    except StorageError as error:
        print("error", error, flush=True)  # noqa: T201
    try:
        log.close()
    except StorageError as error:
        print("close", error, flush=True)  # noqa: T201
    else:
        print("closed", flush=True)  # noqa: T201


if __name__ == "__main__":
    _main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else None)
