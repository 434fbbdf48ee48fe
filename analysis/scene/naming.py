"""Names the balls in one image from the survey's coordinates and the interior orientation alone, and orients the image.

Hypotheses (`analysis.scene.hypotheses`) are refined by least squares with all covariances, and every other surveyed
ball is looked for where the pose puts it, within a chi-squared gate. A hypothesis is believed if chance would not have
made it: the sum over the balls of log10(probability density of the residual / density of detections in the image), less
that of the number of hypotheses that were possible, must exceed a limit. The three balls that agree best do not
count, because three points fit some pose always. The best hypothesis must also be clearly better than any other that
puts the camera elsewhere; otherwise naming is refused.

The same as the paper's step 2A (resection from reference points), where a person had named the points.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, log, log10, perm, pi
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.scene.hypotheses import Approximate, Hypothesis, Search, spread_triples
from analysis.scene.single_pose import Matched, SinglePose, fit_poses, predict, predict_all
from analysis.scene.survey import KnownPoints
from photogrammetry.geometry.camera_model import undistort
from photogrammetry.network.model import Camera
from rig.arrays import Floats, Integers
from rig.errors import BadInputError
from rig.phrase import phrase

GATE: Final = float(chdtri(2, 0.001))
MODEL_SIGMA: Final = 0.1  #: px; what the interior orientation and the balls' shape may leave out
FEWEST: Final = 4  #: balls of an image
_TIERS = ((14, 8), (26, 60), (60, 14))  # detections, the best ones, and triples of balls tried on them
_TIERS_NEAR = ((26, 600), (60, 60))  # the same near an approximate pose, which leaves few hypotheses of each triple
_OF_DETECTIONS = (14, 60)  # detections, the best ones, and triples of them on which all surveyed balls are tried
_MOST_TRIED = 400_000  # triples of surveyed balls on triples of detections: of many balls more are in sight
_BELIEVED = 3.0  # decades by which chance is ruled out
_CLEARLY = 2.0  # decades by which the second best is worse
_OVERWHELMING = 8.0  # decades: such a hypothesis ends the search
_RIVAL_TRIPLES = 3  # of named detections, on which all surveyed balls are tried in search of a rival
_ROUNDS_MOST = 8
_RIVALS = 6  # namings that are kept
_SAME_PLACE = 5.0  # sigmas between the projection centres of two namings that are one
_SAME_IMAGE = 0.01  # of the image's width, by which the balls move between them
_DISTANCE_SIGMA, _ANGLE_SIGMA = 0.05, 0.02  # of the distance; rad: with larger ones the balls do not fix the pose


class NotNamedError(BadInputError):
    """The balls of an image cannot be named; the message says why, without the camera's name."""


@dataclass(frozen=True, slots=True, eq=False)
class Spots:
    """Detections in the metric frame (x right, y up, origin at the image centre).

    Attributes:
        xy: (n, 2), best first.
        covariance: (n, 2, 2).
    """

    xy: Floats
    covariance: Floats

    def __len__(self) -> int:
        return len(self.xy)


@dataclass(frozen=True, slots=True, eq=False)
class Naming:
    """Named balls of one image.

    Attributes:
        pose: from these balls.
        points: (k,) indices of the known points.
        spots: (k,) of the detections.
        expected: number of known points that should be in sight.
        decades: by which chance is ruled out, apart from the number of hypotheses.
        doubtful: whether another pose fits these balls nearly as well (`analysis.scene.reflection`).
    """

    pose: SinglePose
    points: Integers
    spots: Integers
    expected: int
    decades: float
    doubtful: bool = False


def name_balls(camera: Camera, spots: Spots, known: KnownPoints, approximate: Approximate | None = None) -> Naming:
    """Find out which detection is which ball.

    Args:
        camera: with its size.
        spots: what was detected, best first.
        known: surveyed balls.
        approximate: limits the search, and makes it faster.

    Raises:
        NotNamedError: too few detections, known points on a line, no convincing hypothesis, or several.
        BadInputError: the camera has no size.
    """
    if camera.size is None:
        raise BadInputError(f'camera {camera.name}: key "size" is missing; give [width, height]')
    if len(spots) < FEWEST:
        raise NotNamedError(
            phrase(
                "naming_few",
                "{count} balls found, at least {fewest} are needed; clear or light more balls",
                count=len(spots),
                fewest=FEWEST,
            )
        )
    if not spread_triples(known.xyz, 1):
        raise NotNamedError(phrase("naming_line", "the surveyed balls lie on a line: survey one beside it"))
    return _Image(camera, camera.size, spots, known).named(approximate)


@dataclass(frozen=True, slots=True, eq=False)
class _Image:
    """One image, its detections, and the known points."""

    camera: Camera
    size: tuple[int, int]
    spots: Spots
    known: KnownPoints

    def named(self, approximate: Approximate | None) -> Naming:
        """Try hypotheses with the best detections first, then with more of them."""
        ideal = undistort(self.camera.lens(), self.spots.xy)
        ideal = np.where(np.isfinite(ideal), ideal, self.spots.xy - self.camera.interior[1:3])
        search = Search(self.known.xyz, ideal, float(self.camera.interior[0]), self.size, approximate)
        found: list[Naming] = []
        before = (0, 0)
        for limit, triples in _TIERS if approximate is None else _TIERS_NEAR:
            most = min(limit, len(self.spots))
            begin = before[1] if most == before[0] else 0  # these triples were tried on the same detections
            found = self._tried(search, most, slice(begin, triples), found)
            before = most, max(begin, triples)
            if self._convinces(found, search, _BELIEVED):
                break
        else:
            found = self._tried_on_detections(search, found)
        if self._convinces(found, search, _BELIEVED):
            found = self._with_rivals(search, found)
        return self._judged(found, self._chances(search))

    def _convinces(self, found: Sequence[Naming], search: Search, decades: float) -> bool:
        """Whether the best naming rules chance out by so many decades."""
        return bool(found) and found[0].decades - self._chances(search) > decades

    def _tried(self, search: Search, most: int, triples: slice, found: list[Naming]) -> list[Naming]:
        """The best distinct namings after more triples of balls; an overwhelming one ends the search."""
        for triple in spread_triples(self.known.xyz, triples.stop)[triples]:
            hypotheses = search.of_triple(triple, most)
            found = self._with(found, hypotheses, self._chances(search) + _OVERWHELMING)
            if self._convinces(found, search, _OVERWHELMING):
                break
        return found

    def _tried_on_detections(self, search: Search, found: list[Naming]) -> list[Naming]:
        """The best distinct namings after triples of detections.

        Where an image shows a small part of the hill, hardly any triple of surveyed balls lies in it, but most things
        that are round in it are balls.
        """
        most, triples = _OF_DETECTIONS
        triples = min(triples, _MOST_TRIED // perm(len(self.known.names), 3))
        places = np.column_stack((self.spots.xy[:most], np.zeros(min(most, len(self.spots)))))
        for triple in spread_triples(places, triples):
            found = self._with(found, search.of_detections(triple), self._chances(search) + _OVERWHELMING)
            if self._convinces(found, search, _OVERWHELMING):
                break
        return found

    def _with(self, found: Sequence[Naming], hypotheses: Sequence[Hypothesis], enough: float = np.inf) -> list[Naming]:
        """The best distinct namings after more hypotheses; one of more than `enough` decades ends it."""
        more = list(found)
        waiting = list(hypotheses)
        most = 1  # the first one is often right: then the others need not be refined
        while waiting := [one for one in waiting if not any(_is_part(one, naming) for naming in more)]:
            for naming in self._refined(waiting[:most]):
                if naming is not None:
                    more.append(naming)
                    if naming.decades > enough:
                        return self._distinct(more)
            del waiting[:most]
            most = len(waiting)
        return self._distinct(more)

    def _with_rivals(self, search: Search, found: list[Naming]) -> list[Naming]:
        """Other namings of the same detections: what is as good as the best one must name some of these three, too."""
        places = np.column_stack((self.spots.xy, np.zeros(len(self.spots))))
        named = found[0].spots
        for triple in spread_triples(places[named], _RIVAL_TRIPLES):
            found = self._with(found, search.of_detections(named[triple]))
        return found

    def _chances(self, search: Search) -> float:
        """Decades of the number of poses that an exhaustive search would compare."""
        per_triple = max(1.0, search.tried / max(1, search.triples))
        return log10(per_triple) + log10(comb(len(self.known.names), 3))

    def _refined(self, starts: Sequence[Hypothesis]) -> list[Naming | None]:
        """Fit each pose and look for all balls again, until the same ones are found; None where one falls apart."""
        pairs = [(start.points, start.detections) for start in starts]
        poses: list[SinglePose | None] = [SinglePose(s.position, s.rotation, np.zeros((6, 6))) for s in starts]
        active = list(range(len(starts)))
        for _ in range(_ROUNDS_MOST):
            fitted = self._fitted([poses[i] for i in active], [pairs[i] for i in active])
            for i, pose in zip(active, fitted, strict=True):
                poses[i] = pose
            sound = [(i, pose) for i, pose in zip(active, fitted, strict=True) if pose is not None]
            active = []
            for (i, _), new in zip(sound, self._matched([pose for _, pose in sound]), strict=True):
                if not (np.array_equal(new[0], pairs[i][0]) and np.array_equal(new[1], pairs[i][1])):
                    active.append(i)
                pairs[i] = new
            if not active:
                break
        return [
            None if pose is None else self._weighed(pose, *pair)
            for pose, pair in zip(self._fitted(poses, pairs), pairs, strict=True)
        ]

    def _fitted(
        self, poses: Sequence[SinglePose | None], pairs: Sequence[tuple[Integers, Integers]]
    ) -> list[SinglePose | None]:
        """Poses by their points and detections; None where there was none, or too few points."""
        there = [
            (i, pose, *pair)
            for i, (pose, pair) in enumerate(zip(poses, pairs, strict=True))
            if pose is not None and len(pair[0]) >= FEWEST
        ]
        spread = self._covariance()
        matched = [
            Matched(self.known.xyz[points], self.known.covariance[points], self.spots.xy[hits], spread[hits])
            for _, _, points, hits in there
        ]
        found = fit_poses(self.camera.lens(), [pose for _, pose, _, _ in there], matched)
        fitted: list[SinglePose | None] = [None] * len(poses)
        for (i, *_), of_pose in zip(there, found, strict=True):
            fitted[i] = of_pose
        return fitted

    def _covariance(self) -> Floats:
        """(n, 2, 2) of the detections with what the model leaves out."""
        return self.spots.covariance + MODEL_SIGMA**2 * np.eye(2)

    def _matched(self, poses: Sequence[SinglePose]) -> list[tuple[Integers, Integers]]:
        """By pose, known points and the detections on which they fall: mutually nearest, and within the gate."""
        if not poses:
            return []
        xy, from_point, from_pose = predict_all(self.camera.lens(), poses, self.known.xyz, self.known.covariance)
        total = (from_point + from_pose)[:, :, None] + self._covariance()
        a, b, d = total[..., 0, 0], total[..., 0, 1], total[..., 1, 1]
        x, y = np.moveaxis(self.spots.xy - xy[:, :, None], -1, 0)
        with np.errstate(invalid="ignore"):
            squares = (d * x * x - 2 * b * x * y + a * y * y) / (a * d - b * b)
        squares = np.where(np.isfinite(squares), squares, np.inf)
        nearest, back = squares.argmin(axis=2), squares.argmin(axis=1)
        mutual = np.take_along_axis(back, nearest, axis=1) == np.arange(len(self.known.names))
        good = mutual & (squares.min(axis=2) < GATE)
        return [(np.flatnonzero(own), of_pose[own]) for own, of_pose in zip(good, nearest, strict=True)]

    def _weighed(self, fitted: SinglePose, points: Integers, hits: Integers) -> Naming | None:
        """The naming with its evidence."""
        xy, from_point, _ = predict(self.camera.lens(), fitted, self.known.xyz, self.known.covariance)
        off = self.spots.xy[hits] - xy[points]
        if not np.isfinite(off).all():
            return None
        total = from_point[points] + self._covariance()[hits]
        squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(total), off)
        density = len(self.spots) / (self.size[0] * self.size[1])
        gain = -np.log10(2 * pi * density * np.sqrt(np.linalg.det(total))) - squares / (2 * log(10))
        expected = int((np.abs(xy) < np.array(self.size) / 2).all(axis=1).sum())
        ways = comb(max(expected, len(points)) - 3, len(points) - 3)
        # a set of k balls is found from each of its triples, so there are fewer independent chances by their number
        decades = float(np.sort(gain)[:-3].sum()) - log10(ways) + log10(comb(len(points), 3))
        return Naming(fitted, points, hits, expected, decades)

    def _distinct(self, namings: Sequence[Naming]) -> list[Naming]:
        """The best naming of each pose, best first, and not many of them."""
        kept: list[Naming] = []
        for naming in sorted(namings, key=lambda n: -n.decades):
            if not any(self._same_pose(naming, other) for other in kept):
                kept.append(naming)
        return kept[:_RIVALS]

    def _same_pose(self, one: Naming, other: Naming) -> bool:
        """Whether both put the camera at one place: then the balls move little, and so does the camera."""
        apart = float(np.linalg.norm(one.pose.position - other.pose.position))
        sigma = np.sqrt(np.trace(one.pose.covariance[:3, :3]) + np.trace(other.pose.covariance[:3, :3]))
        if apart > _SAME_PLACE * sigma:
            return False
        xy, other_xy = (
            predict(self.camera.lens(), naming.pose, self.known.xyz, self.known.covariance)[0]
            for naming in (one, other)
        )
        off = np.linalg.norm(xy - other_xy, axis=1)
        return bool(np.isfinite(off).any() and np.nanmedian(off) < _SAME_IMAGE * self.size[0])

    def _judged(self, found: Sequence[Naming], chances: float) -> Naming:
        """The best hypothesis, if it is convincing, alone and determined."""
        if not found or found[0].decades - chances < _BELIEVED:
            best = phrase("naming_none_fit", "none by any pose")
            if found:
                best = phrase(
                    "naming_best_fit", "at best {count} by some pose, which may be chance", count=len(found[0].points)
                )
            raise NotNamedError(
                phrase(
                    "naming_unfit",
                    "{spots} round spots found, which do not fit the {balls} surveyed balls ({best}); check survey and "
                    "interior orientation, clear the balls, or give an approximate pose",
                    spots=len(self.spots),
                    balls=len(self.known.names),
                    best=best,
                )
            )
        best_one = found[0]
        rival = next((other for other in found[1:] if not _same_names(best_one, other)), None)
        if rival is not None and rival.decades > best_one.decades - _CLEARLY:
            raise NotNamedError(
                phrase(
                    "naming_ambiguous",
                    "{spots} round spots found, which fit the surveyed balls in two ways ({one} and {other} balls, X0 "
                    "{here} and {there}), so names are ambiguous; show more balls, or give an approximate pose",
                    spots=len(self.spots),
                    one=len(best_one.points),
                    other=len(rival.points),
                    here=_words(best_one),
                    there=_words(rival),
                )
            )
        centre = self.known.xyz[best_one.points].mean(axis=0)
        distance = float(np.linalg.norm(best_one.pose.position - centre))
        sigma = np.sqrt(np.diagonal(best_one.pose.covariance))
        if sigma[:3].max() > _DISTANCE_SIGMA * distance or sigma[3:].max() > _ANGLE_SIGMA:
            raise NotNamedError(
                phrase(
                    "naming_no_pose",
                    "the {count} balls named do not fix the pose, because they lie nearly on a line; show balls "
                    "beside it",
                    count=len(best_one.points),
                )
            )
        return best_one


def _is_part(hypothesis: Hypothesis, naming: Naming) -> bool:
    """Whether a naming has all names of a hypothesis, which would only lead to it again."""
    names = dict(zip(naming.points.tolist(), naming.spots.tolist(), strict=True))
    pairs = zip(hypothesis.points.tolist(), hypothesis.detections.tolist(), strict=True)
    return all(names.get(point) == spot for point, spot in pairs)


def _same_names(one: Naming, other: Naming) -> bool:
    """Whether two namings, at whatever poses, contradict each other in no name, and share those of one of them."""
    names, others = (set(zip(n.points.tolist(), n.spots.tolist(), strict=True)) for n in (one, other))
    return names <= others or others <= names


def _words(naming: Naming) -> str:
    return "(" + ", ".join(f"{value:.1f}" for value in naming.pose.position) + ")"
