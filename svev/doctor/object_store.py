"""Examines the object store that recordings are copied into: does it take an object, and give it back?"""

import time
from collections.abc import Iterator
from typing import Final

from rig.background.child import run_child
from rig.background.messages import End, Failed
from rig.settings.model import RigSettings
from service.offloading.orders import PROGRAM, TryStore
from svev.doctor.finding import Finding, Topic, passed, warning

#: A store that has not taken and given back a few bytes by then does not answer, s; copies wait a minute.
LOOK_S: Final = 30.0


def look_at_store(rig: RigSettings) -> Iterator[Finding]:
    """Write a few bytes into the store, read them back and remove them, by the program that copies recordings."""
    offload = rig.offload
    if offload is None or offload.store is None:
        return
    deadline = time.monotonic() + LOOK_S
    end = run_child(
        PROGRAM,
        TryStore(store=offload.store, options=offload.store_options),
        End,
        busy=lambda: False,
        wanted=lambda: time.monotonic() < deadline,
        yielding=False,
    )
    if end is None:
        what = "{store} (offload.store) did not answer within {seconds:g} s"
        remedy = "check its address and the network; recordings stay here, and are copied when it answers"
        yield warning(Topic.DISK, "check_store_silent", what, remedy, store=offload.store, seconds=LOOK_S)
    elif isinstance(end, Failed):
        remedy = "until then recordings stay here, and none is released"
        yield warning(Topic.DISK, "check_store_refuses", "{why}", remedy, why=end.said)
    else:
        what = "{store} (offload.store) takes copies and gives them back"
        yield passed(Topic.DISK, "check_store", what, store=offload.store)
