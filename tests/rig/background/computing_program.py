"""Started by test_child: computes until it is ended, and tells nobody how far it is; or says its pid and ends."""

import os

from rig.background.messages import End, Order
from rig.background.program import Teller, serve
from rig.transport.message import Message


class Compute(Order):
    """For ever, if `long`."""

    long: bool


class Begun(Message):
    """By this process."""

    pid: int


class Computed(End):
    """It has been done."""


def _work(asked: Compute, tell: Teller) -> Computed:
    tell(Begun(pid=os.getpid()), last=True)
    while asked.long:
        pass
    return Computed()


def main() -> None:
    """Compute."""
    serve({Compute: _work})


if __name__ == "__main__":
    main()
