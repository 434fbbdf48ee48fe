"""Finds targets in triplets, one after the other, and keeps those pictures in which they are still in a new pose.

The kept pictures on the disk are what counts: one that somebody removes is forgotten with the next look.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from analysis.targets.detection import Sight, find_targets
from analysis.targets.moving import Watch
from analysis.targets.pattern import Layout
from analysis.targets.views import views
from rig.api.calibrating import SeenTarget
from rig.api.statement import Level, Statement
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.images.picture import Grey, measurable
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from rig.transport.preview import PreviewImage
from service.aids import frame_of, shown_as
from service.calibrating.folder import MOST_PICTURES, kept_pictures, next_number, picture_path
from service.calibrating.messages import Looked, as_error, stated

_MIRRORED: Final = Statement(
    level=Level.WARNING,
    code="target_mirrored",
    text="the picture shows the target in a mirror",
    advice="turn off the mirror or flip of the camera",
)


class Look:
    """Looks at triplets.

    Args:
        rig: whose triplets they are.
        layout: what was printed.
        folder: of the kept pictures.
    """

    def __init__(self, rig: RigSettings, layout: Layout, folder: Path) -> None:
        self._rig, self._layout, self._folder, self._watch = rig, layout, folder, Watch()
        self._kept: dict[Path, Sight] = {}
        self._number = next_number(folder)

    def at(self, image: PreviewImage) -> Looked:
        """Look at a triplet, keep its pictures if it is time for it, and say what there is.

        Raises:
            OSError: a picture cannot be kept.
        """
        frames = {
            camera.name: measurable(frame_of(image.pixels, self._rig, i), shown_as(self._rig))
            for i, camera in enumerate(self._rig.cameras)
            if image.statuses[i] is FrameStatus.OK
        }
        try:
            seen = {name: find_targets(frame, self._layout, name) for name, frame in frames.items()}
            self._remember()
        except BadInputError as error:
            return Looked(problem=as_error(error.said))
        kept = {camera.name: self._kept_of(camera.name) for camera in self._rig.cameras}
        if len({path.name for path in self._kept}) < MOST_PICTURES and (taken := self._watch.look(seen, kept)):
            for name in sorted(taken):
                self._keep(name, frames[name], seen[name])
                kept[name].append(seen[name])
            self._number += 1
        mirrored = any(sight.mirrored for sight in seen.values())
        return Looked(
            problem=_MIRRORED if mirrored else None,
            still=self._watch.still,
            cameras={camera.name: self._said(camera, seen.get(camera.name), kept) for camera in self._rig.cameras},
        )

    def _kept_of(self, camera: str) -> list[Sight]:
        return [sight for path, sight in self._kept.items() if path.parent.name == camera]

    def _keep(self, camera: str, frame: Grey, sight: Sight) -> None:
        path = picture_path(self._folder, camera, self._number)
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, cv2.imencode(".png", frame)[1].tobytes(), links=False)
        self._kept[path] = sight

    def _remember(self) -> None:
        """Forget pictures that are gone, and look at those that an earlier program has kept."""
        there = kept_pictures(self._folder)
        self._kept = {path: sight for path, sight in self._kept.items() if path in there}
        for path in there:
            if path not in self._kept and (image := _picture(path)) is not None:
                self._kept[path] = find_targets(image, self._layout, path.name)

    def _said(self, camera: CameraSettings, sight: Sight | None, kept: Mapping[str, Sequence[Sight]]) -> SeenTarget:
        """What a camera shows now, and what its kept pictures show."""
        shown, corners = views(kept[camera.name], self._layout), () if sight is None else sight.corners.values()
        return SeenTarget(
            camera=camera.name,
            width=camera.region.width,
            height=camera.region.height,
            corners=tuple((round(corner.x, 2), round(corner.y, 2)) for corner in corners),
            pictures=shown.pictures,
            cells=tuple(map(tuple, shown.cells.tolist())),
            missing=tuple(stated(each) for each in shown.missing),
        )


def _picture(path: Path) -> Grey | None:
    """A kept picture; None: it is gone, or is none.

    OpenCV opens no file itself: it waits for pipes, and dies of names that are no UTF-8.
    """
    try:
        data = np.frombuffer(read_whole(path, TEXT_MAX, links=False), np.uint8)
    except OSError:
        return None
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if len(data) else None
    return None if image is None else np.asarray(image, np.uint8)
