"""Orients the cameras of a recording and watches how they stood in it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from analysis.cameras.frames import FrameSource
from analysis.cameras.oriented_scene import OrientedScene
from analysis.cameras.source import Source, orient_from
from analysis.cameras.steadiness import Steadiness, watch
from analysis.scene.static_image import StaticImage
from photogrammetry.procedures.orientation import Orientation

#: Makes the static image of a camera from some pulses alone.
Anew = Callable[[str, range], StaticImage]


@dataclass(frozen=True, slots=True, eq=False)
class Oriented:
    """Oriented cameras.

    Attributes:
        scene: cameras and balls.
        orientation: the adjustment of the balls; None where the poses were known.
        steadiness: how the cameras stood during the recording.
    """

    scene: OrientedScene
    orientation: Orientation | None
    steadiness: Steadiness


def oriented(
    static: Mapping[str, StaticImage], source: Source, frames: FrameSource, anew: Anew | None = None
) -> Oriented:
    """Orient the cameras of a recording, and again where a knock spoiled the static images.

    A median over two poses shows the balls at neither: their edges stay where one pose has them on one side and the
    other one on the other, and no sigma knows it. So a camera that was knocked is oriented from the longest time
    without a knock, and its moves tell the rest.

    Args:
        static: static image of each camera.
        source: survey of the balls, or poses of the cameras.
        frames: of the recording.
        anew: makes static images anew; None: those given are all there is.

    Raises:
        BadInputError: survey or poses do not belong to these images.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    scene, orientation = orient_from(static, source)
    steadiness = watch(scene, frames)
    if anew is not None and steadiness.still:
        still = {name: anew(name, pulses) for name, pulses in steadiness.still.items()}
        scene, orientation = orient_from({**static, **still}, source)
        steadiness = watch(scene, frames)
    return Oriented(scene, orientation, steadiness)
