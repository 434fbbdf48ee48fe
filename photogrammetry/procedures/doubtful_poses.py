"""Doubtful poses: one of several possible ones, poses other than the given ones, poses of exchanged cameras."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.gross_errors.snooping import BENT
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.diagnosis import (
    Defect,
    DefectKind,
    NotConvergedError,
    NotSolvableError,
    RefusedError,
)
from photogrammetry.network.model import Camera, Network
from photogrammetry.network.selection import with_interior, without_survey
from photogrammetry.procedures.minima import Minimum, moved_images, possible_minima
from photogrammetry.procedures.place_profile import place_holds
from photogrammetry.start_values.resection import resect
from photogrammetry.start_values.search import complete
from photogrammetry.start_values.sightings import reduce_observations
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import phrase

_POINTS_OF_RESECTION: Final = 3  # points of a resection; with so many up to four poses fit exactly
#: Two images are exchanged if each lies so much nearer to where the other is given than to where itself is given.
_NEARER: Final = 0.25
#: Given poses are in another unit if all distances between them differ by one factor beyond this, ...
_OTHER_UNIT: Final = 2.0
_ALIKE: Final = 0.1  # ... whose logarithm varies by no more than this among at least so many distances
_PAIRS: Final = 3
_IMAGES: Final = 8  # with more images one exchange of cameras spoils little, and the pairs are many


def refuse_ambiguous(given: Network, a: Adjustment) -> None:
    """Refuse a result whose images have several possible poses, because three points alone or a plane fix them.

    Nor is one given whose sigmas do not tell where an image may be.

    Args:
        given: the network before it got start values: an image whose pose it gives is decided by that.
        a: the adjusted network.

    Raises:
        NotSolvableError: names the images with their possible places.
    """
    known = {image.name for image in given.images if image.position is not None and image.rotation is not None}
    defects = (*_ambiguities(a, known), *_undecided(given, a, known)) or tuple(_unheld(a, known))
    if defects:
        raise NotSolvableError(defects)


def _unheld(a: Adjustment, known: set[str]) -> Iterator[Defect]:
    """The images whose sigmas do not tell where they may be."""
    for i, image in enumerate(a.network.images):
        if image.name in known or not image.estimate or image.sigma_position is not None or place_holds(a, i):
            continue
        text = (
            "image {image} is hardly determined: the residuals allow places farther from X0 {place} than five of its "
            "sigmas ({sigma}); survey points farther apart or off their plane, come nearer, or give an approximate pose"
        )
        sigma = _place(a.sigmas(a.problem.unknowns.pose[i, :3]))
        place = _place(a.state.position[i])
        said = phrase("defect_weak_place", text, image=image.name, place=place, sigma=sigma)
        yield Defect(DefectKind.IMAGES, 0, said, images=(image.name,))


def _undecided(given: Network, a: Adjustment, known: set[str]) -> Iterator[Defect]:
    """The images that the possible minima put at different places."""
    first, *others = possible_minima(a, given)
    for i, image in enumerate(a.network.images):
        apart = [other for other in others if moved_images(other.adjustment, first.adjustment)[i]]
        if image.name in known or not apart:
            continue
        places, sums = _distinct_places(i, [first, *apart])
        text = (
            "image {image} has {count} poses between which the residuals do not decide, because the surveyed points "
            "nearly lie in a plane: X0 {places} with vTPv {sums}; survey a point off that plane, come nearer, or give "
            "an approximate pose"
        )
        said = phrase(
            "defect_two_poses", text, image=image.name, count=len(places), places=" / ".join(places),
            sums=" / ".join(sums),
        )  # fmt: skip
        yield Defect(DefectKind.IMAGES, 0, said, images=(image.name,))


def _distinct_places(image: int, found: Sequence[Minimum]) -> tuple[list[str], list[str]]:
    """Where the minima put an image, each place once, and their sums of squares."""
    kept: list[Minimum] = []
    for one in found:
        if all(moved_images(one.adjustment, other.adjustment)[image] for other in kept):
            kept.append(one)
    places = [_place(one.adjustment.state.position[image]) for one in kept]
    return places, [f"{one.square_sum:.1f}" for one in kept]


def _place(position: Floats) -> str:
    return f"({', '.join(f'{x:.3f}' for x in position)})"


def _ambiguities(a: Adjustment, known: set[str]) -> Iterator[Defect]:
    counts = np.bincount(a.network.observations.image, minlength=len(a.network.images))
    doubtful = [
        i
        for i, image in enumerate(a.network.images)
        if counts[i] == _POINTS_OF_RESECTION
        and image.estimate
        and image.name not in known
        and image.sigma_position is None
    ]
    if not doubtful:
        return
    sightings = reduce_observations(with_interior(a.network, a.state.interior))
    for i in doubtful:
        try:
            found = resect(a.state.xyz[sightings.points[i]], sightings.xy[i], sightings.c_of(i))
        except BadInputError:
            continue  # two measurements of one point, or points on a line: the rank analysis has judged them
        if found.ambiguous:
            poses = (found.camera, *found.alternatives)
            places = " / ".join(_place(pose.X0) for pose in poses)
            name = a.network.images[i].name
            text = (
                "image {image} shows three points only, which fit {count} poses equally: X0 {places}; measure a fourth "
                "point in it, or give an approximate pose"
            )
            said = phrase("defect_three_points", text, image=name, count=len(poses), places=places)
            yield Defect(DefectKind.IMAGES, 0, said, images=(name,))


def refuse_contradicted(given: Network, a: Adjustment) -> None:
    """Refuse a result whose images lie where other images were given, or by a factor farther apart than given.

    Args:
        given: the network with approximate poses, or without.
        a: the adjusted network.

    Raises:
        RefusedError: says which images or units look exchanged.
    """
    there = {image.name: image.position for image in given.images if image.position is not None}
    pairs = [
        (image.name, there[image.name], a.state.position[i])
        for i, image in enumerate(a.network.images)
        if image.name in there
    ]
    apart = []
    for (one, one_given, one_found), (other, other_given, other_found) in combinations(pairs, 2):
        straight = np.linalg.norm(one_found - one_given) + np.linalg.norm(other_found - other_given)
        crossed = np.linalg.norm(one_found - other_given) + np.linalg.norm(other_found - one_given)
        if crossed < _NEARER * straight:
            text = (
                "images {one} and {other} look exchanged: each was found where the other is given; exchange their "
                "measurements, or their poses if those are wrong"
            )
            raise RefusedError(phrase("refused_exchanged_poses", text, one=one, other=other))
        apart.append((float(np.linalg.norm(one_found - other_found)), float(np.linalg.norm(one_given - other_given))))
    if len(apart) < _PAIRS or min(length for pair in apart for length in pair) <= 0.0:
        return
    factors = np.array([found / given for found, given in apart])
    factor = float(np.median(factors))
    if np.ptp(np.log(factors)) <= _ALIKE and not 1.0 / _OTHER_UNIT < factor < _OTHER_UNIT:
        text = (
            "the images were found {factor} times as far apart as their given poses are: survey and poses have "
            "different units; give both in one"
        )
        raise RefusedError(phrase("refused_units", text, factor=f"{factor:.4g}"))


def refuse_exchanged_cameras(network: Network, ratio: float) -> None:
    """Refuse images that do not fit each other, but do once two of them exchange their cameras.

    Few rays form some block with nearly any cameras. So the survey is asked as well: where the exchange does not help
    there, the block is bad for another reason.

    Args:
        network: with its survey.
        ratio: estimated over a-priori sigma0 that the images alone have as they are; infinite if they form no block.

    Raises:
        RefusedError: names the two images.
    """
    if ratio <= BENT or len(network.images) > _IMAGES:
        return
    alone = without_survey(network)
    enough = min(ratio, BENT * BENT) if np.isinf(ratio) else ratio  # beside no block at all any other one looks good
    trials = [(trial, pair) for pair, other in _exchanges(alone) if (trial := _ratio(other)) * BENT < enough]
    if not trials:
        return
    least, (one, other) = min(trials)
    with_survey = next(exchanged for pair, exchanged in _exchanges(network) if pair == (one, other))
    as_they_are = _ratio(network)
    if np.isfinite(as_they_are) and _ratio(with_survey) * BENT >= as_they_are:
        return
    text = (
        "images {one} and {other} look exchanged: once each has the other's camera, sigma0 is {least} times the a "
        "priori one, and {before} times as they are; exchange their measurements or their cameras"
    )
    before, found = f"{ratio:.3g}", f"{least:.3g}"
    raise RefusedError(phrase("refused_exchanged_cameras", text, one=one, other=other, least=found, before=before))


def _exchanges(network: Network) -> Iterator[tuple[tuple[str, str], Network]]:
    """Pairs of images of different cameras, and the network with the cameras exchanged; no poses are given."""
    images = [replace(image, position=None, rotation=None) for image in network.images]
    for i, k in combinations(range(len(images)), 2):
        one, other = images[i], images[k]
        if _alike(network.cameras[one.camera], network.cameras[other.camera]):
            continue
        changed = list(images)
        changed[i], changed[k] = replace(one, camera=other.camera), replace(other, camera=one.camera)
        yield (one.name, other.name), replace(network, images=tuple(changed))


def _alike(one: Camera, other: Camera) -> bool:
    """Whether nothing tells two cameras apart: they differ in nothing but parameters that both estimate freely."""
    free = [all(name in camera.estimate and name not in camera.sigma for camera in (one, other)) for name in INTERIOR]
    sides = [(camera.distortion, camera.balance) for camera in (one, other)]
    return bool(np.all(free | (one.interior == other.interior))) and sides[0] == sides[1]


def _ratio(network: Network) -> float:
    try:
        return adjust_once(network, state_of(complete(network))).ratio
    except (BadInputError, NotSolvableError, NotConvergedError):
        return float("inf")
