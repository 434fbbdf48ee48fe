"""Orients the cameras again with the moving helmet as tie points (paper, step 2, alternative 2; footnote 3).

Balls stand beside the flight, the helmet flies through the middle of it: each pulse in which two cameras or more
measured it gives a point that ties their images where the jumper is measured.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis.cameras.oriented_scene import OrientedScene, scene_of_survey
from analysis.cameras.standing import FrameShake, SteadiedJump, steadied
from analysis.measurements.model import MeasuredCamera, PulseMeasurements
from analysis.scene.camera_system import CameraSystem
from analysis.scene.orientation import scene_of
from photogrammetry.geometry.rotation import vector_from_rotation
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import ImageObservations, Network, Point, Role
from photogrammetry.procedures.orientation import Orientation, orient
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import phrase

HELMET = "P1"
_MOVING = "H*"  # names of the helmet's places


def with_helmet(
    scene: OrientedScene, flights: Sequence[SteadiedJump], cameras: Mapping[str, MeasuredCamera], rate_hz: float
) -> tuple[OrientedScene, Orientation]:
    """The scene, oriented by the balls and the helmet, and the adjustment.

    Args:
        scene: oriented from its own images and a survey.
        flights: the jumps.
        cameras: exposure times by camera; a helmet belongs to the middle of the exposure.
        rate_hz: pulses per second.

    Raises:
        BadInputError: the poses come from a calibration, or no helmet was measured by two cameras.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    if scene.changes:
        raise BadInputError(
            "the helmet cannot improve poses of a calibration; orient the log with --survey, or without --alternative 2"
        )
    places: dict[int, dict[str, tuple[Floats, Floats]]] = {}
    for flight in flights:
        places |= _places(scene.system, flight, {n: c.exposure_s / 2 * rate_hz for n, c in cameras.items()})
    if not places:
        raise BadInputError(
            "no helmet was measured by two cameras, so nothing ties the images in flight; drop --alternative 2"
        )
    network = _joined(scene.network, places)
    orientation = orient(network, alternative=2, moving=_MOVING, uncertain_interior=True)
    text = "{count} places of the helmet tie the images beside the balls"
    notes = [phrase("scene_helmet", text, count=len(places))]
    found = [finding.said for stage in orientation.stages for finding in stage.findings]
    notes += [message for message in found if message not in scene.messages]
    again = scene_of_survey(scene_of(network, orientation, scene.static, {}, (*scene.messages, *notes)), scene.given)
    return replace(again, balls={n: ball for n, ball in again.balls.items() if n in scene.balls}), orientation


def _places(
    system: CameraSystem, flight: SteadiedJump, middle: Mapping[str, float]
) -> dict[int, dict[str, tuple[Floats, Floats]]]:
    """By pulse and camera, where the helmet would be in the static image (px), and sigmas; in two cameras at least."""
    mean = float(np.mean([middle.get(name, 0.0) for name in system.names]))
    found: dict[int, dict[str, tuple[Floats, Floats]]] = {}
    for name in system.names:
        if name not in flight.system.cameras:
            continue
        placed, there = system[name], flight.system[name]
        turn = FrameShake(vector_from_rotation(placed.rotation.T @ there.rotation), np.zeros((3, 3)))
        for pulse, xy, sigma in _seen(flight.measurements.pulses, name, mean - middle.get(name, 0.0)):
            found.setdefault(pulse, {})[name] = steadied(placed, turn, xy[None])[0][0], sigma
    return {pulse: images for pulse, images in sorted(found.items()) if len(images) > 1}


def _seen(pulses: Sequence[PulseMeasurements], camera: str, later: float) -> Iterator[tuple[int, Floats, Floats]]:
    """Pulse, place and sigmas of the helmet in a camera, `later` pulses after the middle of its exposure."""
    places = {
        int(pulse.pulse): pulse.images[camera].points[HELMET]
        for pulse in pulses
        if camera in pulse.images and HELMET in pulse.images[camera].points
    }
    for pulse, point in places.items():
        xy = point.xy
        if later:
            near = [p for p in (pulse - 1, pulse, pulse + 1) if p in places]
            if len(near) < 2:
                continue
            xy = xy + later * (places[near[-1]].xy - places[near[0]].xy) / (near[-1] - near[0])
        yield pulse, xy, np.sqrt(np.diagonal(point.covariance))


def _joined(network: Network, places: Mapping[int, Mapping[str, tuple[Floats, Floats]]]) -> Network:
    """The network with the helmet's places as tie points H1, H2, ... by pulse."""
    taken = {point.name for point in network.points}
    image_at = {image.name: i for i, image in enumerate(network.images)}
    points = list(network.points)
    rows = []
    for pulse, images in places.items():
        name = f"H{pulse}"
        while name in taken:
            name += "h"
        rows += [(image_at[camera], len(points), xy, sigma) for camera, (xy, sigma) in images.items()]
        points.append(Point(name, Role.TIE))
    sizes = np.array([network.cameras[network.images[row[0]].camera].size for row in rows], float)
    o = network.observations
    more = ImageObservations(
        np.concatenate((o.image, [row[0] for row in rows])),
        np.concatenate((o.point, [row[1] for row in rows])),
        np.concatenate((o.xy, pixel_to_metric(np.array([row[2] for row in rows]), sizes))),
        np.concatenate((o.sigma, [row[3] for row in rows])),
        np.concatenate((o.group, np.zeros(len(rows), np.intp))),
        o.groups,
    )
    return replace(network, points=tuple(points), observations=more)
