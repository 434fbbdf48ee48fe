"""The program that finds targets in live pictures and keeps those in which they are still, started by `helper`."""

import os
import time
from pathlib import Path
from typing import Any, Final

from rig.background.program import Teller, serve
from rig.settings.model import RigSettings
from rig.transport.preview import PreviewSlot

#: The recorder goes on copying images for so long after each request.
_LEASE_S: Final = 3.0
_POLL_S: Final = 0.02
#: As the live analysis has it: recorder and grabbers come first. Somebody holds the target still meanwhile, so it does
#: not wait until nobody else wants the processor; while a recording runs it stands still.
_NICE: Final = 10


def _find(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Look at live pictures of the slot `fd` for targets of `layout`, keep some in `folder`; ends with its caller."""
    os.nice(_NICE)
    import cv2  # noqa: PLC0415 - these start their threads with our low priority

    from analysis.targets.pattern import Layout  # noqa: PLC0415
    from service.calibrating.look import Look  # noqa: PLC0415

    cv2.setNumThreads(1)  # the other processors are for cameras and recorder
    rig = RigSettings.model_validate(asked["rig"])
    look = Look(rig, Layout(**asked["layout"]), Path(asked["folder"]))
    slot, last = PreviewSlot(asked["fd"]), 0
    while True:
        slot.want(_LEASE_S)
        if slot.newest() in {0, last} or (image := slot.read()) is None or image.pixels.shape != rig.triplet_shape:
            time.sleep(_POLL_S)
            continue
        last = image.pulse
        tell(last=True, **look.at(image))


if __name__ == "__main__":
    serve(_find)
