"""What places under the pointer mean in space before they are marks: curves in other images, a length between two."""

from collections.abc import Mapping

import numpy as np

from analysis.digitizing.geometry.epipolar import epipolar_curves
from analysis.digitizing.geometry.space import Ray, intersected, predicted_points, space_points
from analysis.digitizing.marks.effective import covariance_of
from analysis.digitizing.marks.journal import Entered
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import Curve, Estimate, Geometry, TapeOrder
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import phrase


def geometry_of(
    system: CameraSystem, camera: str, thing: str, xy: tuple[float, float], others: Mapping[str, Ray]
) -> Geometry:
    """What one place in one image means for the others.

    Args:
        system: the oriented cameras.
        camera: in whose image the place is; nothing follows from one that is not oriented.
        thing: what is there.
        xy: the place, px.
        others: rays of the same thing at the same pulse, by camera.
    """
    if camera not in system.names:
        return Geometry(curves={}, space=None, predicted={})
    place, covariance = np.array(xy, float), covariance_of(Entered(xy=xy))
    curves = epipolar_curves(system, camera, place, covariance)
    found = intersected(system, {thing: {**others, camera: Ray(place, covariance)}})
    return Geometry(
        curves={
            name: Curve(line=_list(curve.line), low=_list(curve.low), high=_list(curve.high))
            for name, curve in curves.items()
            if len(curve.line)
        },
        space=space_points(system, found)[thing],
        predicted={name: points[thing] for name, points in predicted_points(system, found).items()},
    )


def length_of(system: CameraSystem, order: TapeOrder) -> Estimate:
    """The distance between two things that were clicked in two images or more each, m.

    Raises:
        BadInputError: their rays do not give both places.
    """
    clicks = {
        end: {camera: Ray(np.array(xy), covariance_of(Entered(xy=xy))) for camera, xy in places.items()}
        for end, places in (("start", order.start), ("end", order.end))
    }
    found = intersected(system, clicks).adjusted
    if not found.ok.all():
        raise BadInputError(phrase("hand_ends", "the clicks do not give both ends: click each in two images or more"))
    way = found.state[1] - found.state[0]
    length = float(np.linalg.norm(way))
    if not length:
        return Estimate(value=0.0, sigma=float(np.sqrt(np.trace(found.image_covariance.sum(axis=0)))))
    along = way / length
    influence = along @ (found.by_calibration[1] - found.by_calibration[0])
    variance = along @ found.image_covariance.sum(axis=0) @ along + influence @ system.covariance @ influence
    return Estimate(value=length, sigma=float(np.sqrt(variance)))


def _list(line: Floats) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in np.round(line, 3)]
