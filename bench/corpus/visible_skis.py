"""Which skis a person would see in the images of a log: those that stand out of what is beside them.

A ski as grey as the snow behind it is in sight, but nobody can measure it; neither one that another ski or the body
covers. So each ski is looked at where it truly is. Along its axis, boots and shovel left out, the grey value is
compared with the mean of both sides. Pieces of eight pixels stand out if that differs by more than three standard
deviations, which the sides tell; a ski is seen if more than half of its pieces do.
"""

from collections.abc import Mapping
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.cameras.frames import LogFrames
from analysis.measurements.model import BINDING_OF
from bench.analysis.hill_logs import HillLog
from bench.corpus.draws import Scene
from rig.arrays import Flags, Floats
from simrig.world.projection import Projection

#: Grey values (rows, columns).
_Image: TypeAlias = NDArray[np.float32]
#: Tail and fore part, m from the binding.
_PARTS_M: Final = ((-1.05, -0.3), (0.3, 0.9))
_ASIDE_M, _ASIDE_PX = 0.07, 2.0  # from the axis to what is beside the ski: half its width and the blur
_PIECE_PX: Final = 8
_SIGMAS: Final = 3.0
_SHARE: Final = 0.5
_MAD_TO_SIGMA: Final = 1.4826


def visible_skis(scene: Scene, log: HillLog) -> dict[int, dict[str, int]]:
    """By pulse: how many cameras show each ski.

    Args:
        scene: the scene.
        log: its log with the truth.
    """
    cameras = {camera.name: camera.projection(*scene.size) for camera in scene.scenario.cameras}
    present = {number: state for number, state in log.truth.items() if state.get("points")}
    found = {}
    for number, frames in LogFrames(log.path).frames(set(present)):
        shown = [(image.astype(np.float32), cameras[name]) for name, image in frames.items()]
        found[int(number)] = {
            side: sum(_seen(image, camera, present[number], side) for image, camera in shown) for side in BINDING_OF
        }
    return found


def _seen(image: _Image, camera: Projection, state: Mapping[str, Any], side: str) -> bool:
    """Whether a person would see a ski in an image."""
    binding, direction = np.array(state["points"][BINDING_OF[side]]), np.array(state["skis"][side]["direction"])
    distance = float(camera.distance(binding))
    if distance <= 0:
        return False
    aside = _ASIDE_M * camera.c / distance + _ASIDE_PX
    told = np.concatenate([_stand_out(image, camera, binding + np.outer(part, direction), aside) for part in _PARTS_M])
    return bool(len(told) and np.mean(told) > _SHARE)


def _stand_out(image: _Image, camera: Projection, ends: Floats, aside: float) -> Flags:
    """Of the pieces between two places (2, 3) of a ski, which stand out of their sides; none outside of the image."""
    px = camera.pixels(ends)
    length = float(np.hypot(*(px[1] - px[0])))
    count = int(length // _PIECE_PX)
    if not count:
        return np.zeros(0, bool)
    along = (px[1] - px[0]) / length
    across = aside * np.array((-along[1], along[0]))
    axis = px[0] + np.arange(count * _PIECE_PX)[:, None] * along
    on, left, right = (_grey(image, axis + side * across).reshape(count, -1) for side in (0.0, 1.0, -1.0))
    difference = left - right
    noise = _MAD_TO_SIGMA * float(np.median(np.abs(difference - np.median(difference)))) / np.sqrt(2)
    off = (on - (left + right) / 2).mean(axis=1)
    inside = camera.sees(axis).reshape(count, -1).all(axis=1)
    return np.asarray(inside & (np.abs(off) > _SIGMAS * noise * np.sqrt(1.5 / _PIECE_PX)))


def _grey(image: _Image, xy: Floats) -> Floats:
    x, y = xy.astype(np.float32).T.reshape(2, 1, -1)
    return np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0])
