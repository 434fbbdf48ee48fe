"""The program that finds targets in live pictures and keeps those in which they are still, started by `helper`.

The kept pictures on the disk are what counts: one that somebody removes is forgotten with the next look.
"""

import os
import time
from pathlib import Path
from typing import Any, Final

from rig.background.program import Teller, serve
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.host.disk import replace_file
from rig.images.picture import measurable
from rig.phrase import as_plain
from rig.settings.model import RigSettings
from rig.transport.preview import PreviewImage, PreviewSlot
from service.aids import frame_of, shown_as
from service.calibrating.folder import MOST, kept_pictures, next_number, picture_path

#: The recorder goes on copying images for so long after each request.
_LEASE_S: Final = 3.0
_POLL_S: Final = 0.02
#: As the live analysis has it: recorder and grabbers come first. Somebody holds the target still meanwhile, so it does
#: not wait until nobody else wants the processor; while a recording runs it stands still.
_NICE: Final = 10


def _find(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Look at live pictures of the slot `fd` for targets of `layout`, keep some in `folder`; ends with its caller."""
    os.nice(_NICE)
    from analysis.targets.pattern import Layout  # noqa: PLC0415 - its libraries start their threads with our low priority

    rig = RigSettings.model_validate(asked["rig"])
    look = _Look(rig, Layout(**asked["layout"]), Path(asked["folder"]))
    slot, last = PreviewSlot(asked["fd"]), 0
    while True:
        slot.want(_LEASE_S)
        if slot.newest() in {0, last} or (image := slot.read()) is None or image.pixels.shape != rig.triplet_shape:
            tell()  # stands still here while a recording runs
            time.sleep(_POLL_S)
            continue
        last = image.pulse
        tell(last=True, **look.at(image))


class _Look:
    """Finds targets in triplets, one after the other."""

    def __init__(self, rig: RigSettings, layout: Any, folder: Path) -> None:
        from analysis.targets.detection import Sight  # noqa: PLC0415 - as above
        from analysis.targets.moving import Watch  # noqa: PLC0415

        self._rig, self._layout, self._folder, self._watch = rig, layout, folder, Watch()
        self._kept: dict[Path, Sight] = {}
        self._number = next_number(folder)

    def at(self, image: PreviewImage) -> dict[str, Any]:
        """Look at a triplet, keep its pictures if it is time for it, and say what there is."""
        import cv2  # noqa: PLC0415 - as above

        from analysis.targets.detection import find_targets  # noqa: PLC0415

        frames = {
            camera.name: measurable(frame_of(image.pixels, self._rig, i), shown_as(self._rig))
            for i, camera in enumerate(self._rig.cameras)
            if image.statuses[i] is FrameStatus.OK
        }
        try:
            seen = {name: find_targets(frame, self._layout, name) for name, frame in frames.items()}
            self._remember()
        except BadInputError as error:
            return {"problem": as_plain(error.said)}
        by_camera = {
            name: [sight for path, sight in self._kept.items() if path.parent.name == name]
            for name in (camera.name for camera in self._rig.cameras)
        }
        taken = frozenset[str]()
        if len({path.name for path in self._kept}) < MOST:
            taken = self._watch.look(seen, by_camera)
        for name in sorted(taken):
            path = picture_path(self._folder, name, self._number)
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, cv2.imencode(".png", frames[name])[1].tobytes(), links=False)
            self._kept[path] = seen[name]
            by_camera[name].append(seen[name])
        self._number += bool(taken)
        mirrored = [name for name, sight in seen.items() if sight.mirrored]
        return {
            "still": self._watch.still,
            "mirrored": mirrored,
            "cameras": {name: _said(seen.get(name), kept, self._layout) for name, kept in by_camera.items()},
        }

    def _remember(self) -> None:
        """Forget pictures that are gone, and look at those that an earlier program has kept."""
        import cv2  # noqa: PLC0415 - as above

        from analysis.targets.detection import find_targets  # noqa: PLC0415

        there = kept_pictures(self._folder)
        self._kept = {path: sight for path, sight in self._kept.items() if path in there}
        for path in there:
            if path not in self._kept and (image := cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) is not None:
                self._kept[path] = find_targets(image.astype("uint8"), self._layout, path.name)


def _said(sight: Any, kept: list[Any], layout: Any) -> dict[str, Any]:
    """What a camera shows now (a `Sight`), and what its kept pictures show."""
    from analysis.targets.views import views  # noqa: PLC0415 - as above

    shown = views(kept, layout)
    corners = [] if sight is None else [(round(c.x, 2), round(c.y, 2)) for c in sight.corners.values()]
    return {
        "corners": corners,
        "pictures": shown.pictures,
        "cells": shown.cells.tolist(),
        "missing": [as_plain(each) for each in shown.missing],
    }


if __name__ == "__main__":
    serve(_find)
