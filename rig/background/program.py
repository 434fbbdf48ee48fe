"""The frame of such a program: what it is told, and how it says how far it is."""

import time
from collections.abc import Callable, Mapping
from functools import reduce
from operator import or_
from typing import Any, Final

from rig.background.messages import End, Failed, Order, Ready
from rig.errors import SvevError
from rig.phrase import plain
from rig.transport.channel import ControlChannel
from rig.transport.child import begin
from rig.transport.message import Message, Quit

#: Between two messages that say how far it is.
_TELL_S: Final = 0.1
_SENT_S: Final = 1.0


class Teller:
    """Says how far the work is."""

    def __init__(self, control: ControlChannel[Any]) -> None:
        self._control, self._told = control, 0.0

    def __call__(self, message: Message, *, last: bool = False) -> None:
        """Say it, unless something was said a moment ago.

        Args:
            message: what is said.
            last: of its kind; it is said in any case.
        """
        if last or time.monotonic() - self._told > _TELL_S:
            self._told = time.monotonic()
            self._control.send(message)


def serve(works: Mapping[type[Order], Callable[[Any, Teller], End]]) -> None:
    """Do what is ordered, and say what it has come to; the whole of such a program.

    It ends with the service, also while it stands still: the kernel kills it.

    Args:
        works: what is done, by the type of the order. It takes the order and whom to tell; its libraries are to be
            imported within, so that their threads have our low priority too.
    """
    orders: Any = reduce(or_, works)
    child = begin(orders, Quit, grace_s=0.0, killed_with_parent=True)
    order: Order = child.config
    child.control.send(Ready())
    try:
        end = works[type(order)](order, Teller(child.control))
    except SvevError as error:
        end = Failed(said=error.said)
    except OSError as error:
        end = Failed(said=plain(str(error)))
    child.control.send(end)
    while child.control.waiting:  # longer than any deadline, if it stands still meanwhile
        child.control.drain(_SENT_S)
