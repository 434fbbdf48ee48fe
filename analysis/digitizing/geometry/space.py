"""Points, skis and the stick model of one pulse from the marks in its images, while a person measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Final, Literal

import numpy as np

from analysis.digitizing.marks.things import LANDMARK, LINES
from analysis.measurements.model import SIDES, PulseMeasurements
from analysis.pulses.gross_errors import Checked, check_points, check_skis
from analysis.pulses.least_squares import Adjusted, Condition, adjust
from analysis.pulses.points import Points
from analysis.pulses.skis import SkiLines, skis_of
from analysis.pulses.states import Solved, jumper_states
from analysis.result.model import JumperState
from analysis.scene.camera_system import CameraSystem
from photogrammetry.intersection.image_line import fit_image_lines
from photogrammetry.intersection.trifocal import check_sides
from rig.api.digitizing import Estimate, PredictedPoint, SideCheck, SpaceLine, SpacePoint
from rig.arrays import Floats
from rig.phrase import Phrase, phrase

#: Test values beyond which a ray is named: one sound ray in a thousand.
_NAMED_W: Final = 3.29
#: Probability from which the side check is believed.
_SURE_OF_SIDE: Final = 0.99
_SKIS: Final = {
    "right": phrase("hand_right_ski", "right ski"),
    "left": phrase("hand_left_ski", "left ski"),
}
_WORDS: Final = {
    Condition.FEW_IMAGES: "one ray",
    Condition.UNDETERMINED: "the rays are parallel within their accuracy",
    Condition.IMPOSSIBLE: "the rays do not meet before the cameras",
}


@dataclass(frozen=True, slots=True, eq=False)
class Ray:
    """A measured image point: xy (2,) px and covariance (2, 2) px^2."""

    xy: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PointsInSpace:
    """Intersected points, in the order in which they were given.

    Attributes:
        names: of the n points.
        points: as they were measured.
        adjusted: from all rays.
    """

    names: Sequence[str]
    points: Points
    adjusted: Adjusted

    def some(self, rows: Sequence[int]) -> "PointsInSpace":
        """Some of the points, by their rows, in this order."""
        index = np.array(rows, np.intp)
        picked = {field.name: getattr(self.adjusted, field.name)[index] for field in fields(Adjusted)}
        return PointsInSpace([self.names[i] for i in rows], self.points.subset(index), Adjusted(**picked))


def intersected(system: CameraSystem, measured: Mapping[str, Mapping[str, Ray]]) -> PointsInSpace:
    """Intersect points from the rays of their images.

    Args:
        system: the m oriented cameras; rays of others are left out.
        measured: rays by camera, by point.
    """
    cameras = tuple(system.cameras.values())
    n, m = len(measured), len(cameras)
    xy, covariance = np.zeros((n, m, 2)), np.tile(np.eye(2), (n, m, 1, 1))
    seen = np.zeros((n, m), bool)
    for i, by_camera in enumerate(measured.values()):
        for j, camera in enumerate(cameras):
            if (ray := by_camera.get(camera.name)) is not None:
                xy[i, j], covariance[i, j], seen[i, j] = ray.xy, ray.covariance, True
    points = Points(cameras, len(system.covariance), xy, covariance, seen, seen, *np.zeros((2, n, m, 3)))
    return PointsInSpace(tuple(measured), points, adjust(points, system.covariance))


def space_points(system: CameraSystem, found: PointsInSpace) -> dict[str, SpacePoint]:
    """Intersected points for a page, each with its residuals, tests, and the ray that does not fit."""
    adjusted, points = found.adjusted, found.points
    with np.errstate(all="ignore"):
        equations = points.equations(adjusted.state)
    result = {}
    for i, name in enumerate(found.names):
        rays = [camera for j, camera in enumerate(system.names) if points.seen[i, j]]
        if not adjusted.ok[i]:
            status = _WORDS[Condition(adjusted.condition[i])] if rays else "not measured"
            result[name] = SpacePoint(X=None, sigma=None, status=status, rays=rays, residuals={}, w={})
            continue
        w = _by_camera(system, adjusted.w[i])
        residuals = {
            camera: (-float(equations.v[i, j, 0]), -float(equations.v[i, j, 1]))
            for j, camera in enumerate(system.names)
            if points.seen[i, j]
        }
        sigma = np.sqrt(np.diagonal(adjusted.covariance[i]))
        result[name] = SpacePoint(
            X=_triple(adjusted.state[i]),
            sigma=_triple(sigma),
            status="controlled" if len(rays) > 2 else "two rays",
            rays=rays,
            residuals=residuals,
            w=w,
            finding=_misfit(
                name.removeprefix(LANDMARK).replace("_", " "),
                w,
                {camera: float(np.hypot(*r)) for camera, r in residuals.items()},
            ),
        )
    return result


def predicted_points(system: CameraSystem, found: PointsInSpace) -> dict[str, dict[str, PredictedPoint]]:
    """Where images without a mark of a point should show it, by camera and point.

    The ellipse holds the error of the rays and those of all orientations, which the point shares with the image.
    """
    result: dict[str, dict[str, PredictedPoint]] = {}
    adjusted, points = found.adjusted, found.points
    rows = np.flatnonzero(adjusted.ok).tolist()
    if not rows:
        return result
    xyz = adjusted.state[rows]
    for j, camera in enumerate(points.cameras):
        px = camera.project(xyz)
        _, by_point, by_camera = camera.linearised(xyz, np.nan_to_num(px))
        for k, i in enumerate(rows):
            if points.seen[i, j] or not inside(px[k], camera.size):
                continue
            influence = by_point[k] @ adjusted.by_calibration[i]
            influence[:, camera.columns] += by_camera[k]
            covariance = (
                by_point[k] @ adjusted.image_covariance[i] @ by_point[k].T + influence @ system.covariance @ influence.T
            )
            result.setdefault(camera.name, {})[found.names[i]] = predicted(px[k], covariance, "rays")
    return result


def predicted(xy: Floats, covariance: Floats, source: Literal["rays", "time"]) -> PredictedPoint:
    """A predicted point with its ellipse of one sigma."""
    values, vectors = np.linalg.eigh(covariance)
    major, minor = np.sqrt(np.maximum(values[::-1], 0.0))
    angle = np.arctan2(vectors[1, 1], vectors[0, 1])
    return PredictedPoint(
        xy=(float(xy[0]), float(xy[1])), ellipse=(float(major), float(minor), float(angle)), source=source
    )


@dataclass(frozen=True, slots=True, eq=False)
class Stick:
    """Skis and figures of a pulse."""

    lines: dict[str, SpaceLine]
    figures: dict[str, Estimate]


@dataclass(frozen=True, slots=True, eq=False)
class SkisInSpace:
    """Both skis of a pulse, intersected.

    Attributes:
        skis: as they were measured.
        adjusted: from all images.
        checked: from the images that are in order.
        sides: whether left and right fit together; None: too few images.
        lines: names of those that are measured in some image.
    """

    skis: SkiLines
    adjusted: Adjusted
    checked: Checked
    sides: SideCheck | None
    lines: tuple[str, ...]


def intersected_skis(system: CameraSystem, pulse: PulseMeasurements) -> SkisInSpace:
    """Intersect the skis of a pulse."""
    skis = skis_of(system, [pulse])
    adjusted = adjust(skis, system.covariance)
    lines = tuple(name for name in LINES if any(LINES[name] in image.skis for image in pulse.images.values()))
    return SkisInSpace(skis, adjusted, check_skis(skis, adjusted, system.covariance), _sides(system, pulse), lines)


def checked_points(system: CameraSystem, found: PointsInSpace) -> Checked:
    """Points from the images that are in order."""
    return check_points(found.points, found.adjusted, system.covariance)


def stick(system: CameraSystem, pulse: int, points: PointsInSpace, good: Checked, skis: SkisInSpace) -> Stick:
    """Skis in space, and angles and height from them and from the points, of one pulse.

    Args:
        system: the oriented cameras.
        pulse: its number.
        points: P1 to P4 of this pulse, in this order.
        good: the same from the images that are in order.
        skis: of this pulse.
    """
    state = jumper_states(
        Solved(good, points.points.by_hand, skis.checked, skis.skis.by_hand), np.array([pulse]), np.zeros(1), system
    )[0]
    return Stick({name: _line(system, skis, state, name) for name in skis.lines}, _figures(state))


def _line(system: CameraSystem, skis: SkisInSpace, state: JumperState, name: str) -> SpaceLine:
    i, side, adjusted, sides = list(LINES).index(name), LINES[name], skis.adjusted, skis.sides
    ski, seen = state.skis[side], int(skis.skis.seen[i].sum())
    if not adjusted.ok[i]:
        words = _WORDS[Condition(adjusted.condition[i])] if seen != 1 else "one image"
        return SpaceLine(slope=None, heading=None, status=words, w={}, sides=sides)
    w = _by_camera(system, adjusted.w[i])
    residual = {c: float(r) for c, r in zip(system.names, adjusted.residual[i], strict=True) if np.isfinite(r)}
    return SpaceLine(
        slope=None if ski is None else Estimate(value=ski.slope.value, sigma=ski.slope.sigma),
        heading=None if ski is None else Estimate(value=ski.heading.value, sigma=ski.heading.sigma),
        status="controlled" if seen > 2 else "two images",
        w=w,
        finding=_misfit(_SKIS[side], w, residual),
        sides=sides,
    )


def _sides(system: CameraSystem, pulse: PulseMeasurements) -> SideCheck | None:
    """Whether left and right fit together, from the lines of both skis in three images; None with fewer."""
    both = [name for name in system.names if name in pulse.images and len(pulse.images[name].skis) == len(SIDES)]
    if len(both) < 3:
        return None
    three = both[:3]
    skis = [[pulse.images[name].skis[side] for name in three] for side in SIDES]
    most = max(len(ski.xy) for line in skis for ski in line)
    xy, seen = np.zeros((len(SIDES), 3, most, 2)), np.zeros((len(SIDES), 3, most), bool)
    for i, line in enumerate(skis):
        for j, ski in enumerate(line):
            xy[i, j, : len(ski.xy)] = system[three[j]].reduced(ski.xy)
            seen[i, j, : len(ski.xy)] = True
    sigma = float(np.sqrt(np.mean([np.mean(ski.sigma**2) + ski.common**2 for line in skis for ski in line])))
    right, left = (fit_image_lines(xy[i][None], sigma, seen=seen[i][None]) for i in range(len(SIDES)))
    check = check_sides([system[name].ideal() for name in three], left, right)
    if not check.fits[0] or check.confidence[0] < _SURE_OF_SIDE:
        # The check takes the orientations for exact: beside their errors lines of sound measurements may fit badly.
        unknown = phrase("hand_sides_unknown", "left and right cannot be told by these lines: compare by eye")
        return SideCheck(ok=None, said=unknown)
    if check.proposal[0] < 0:
        return SideCheck(ok=True, said=phrase("hand_sides_agree", "left and right agree in all three images"))
    text = "left and right are interchanged in {camera}: interchange them there"
    return SideCheck(ok=False, said=phrase("hand_sides_changed", text, camera=three[check.proposal[0]]))


def _figures(state: JumperState) -> dict[str, Estimate]:
    known = {**state.angles, "height": state.height}
    return {name: Estimate(value=q.value, sigma=q.sigma) for name, q in known.items() if q is not None}


def _misfit(name: str | Phrase, w: Mapping[str, float], px: Mapping[str, float]) -> Phrase | None:
    """Which ray does not fit, if one is beyond what chance gives."""
    worst = max(w, key=lambda camera: w[camera], default=None)
    if worst is None or w[worst] < _NAMED_W:
        return None
    if sum(value > _NAMED_W for value in w.values()) > 1 and len(w) < 3:
        text = "the rays of {thing} do not meet: {px:.1f} px, w = {w:.1f}; one of both is wrong"
        return phrase("hand_rays_apart", text, thing=name, px=px.get(worst, 0.0), w=w[worst])
    text = "{camera}'s {thing} does not fit: {px:.1f} px, w = {w:.1f}"
    return phrase("hand_misfit", text, camera=worst, thing=name, px=px.get(worst, 0.0), w=w[worst])


def _by_camera(system: CameraSystem, values: Floats) -> dict[str, float]:
    return {name: float(value) for name, value in zip(system.names, values, strict=True) if np.isfinite(value)}


def inside(px: Floats, size: Floats) -> bool:
    """Whether a place (2,) is in an image of width and height `size` (2,), px."""
    return bool(np.isfinite(px).all() and (px > -0.5).all() and (px < size - 0.5).all())


def _triple(vector: Floats) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
