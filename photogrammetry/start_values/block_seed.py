"""The first two images of a block: the paper's step 1Ba, relative orientation of a well-chosen pair."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from photogrammetry.start_values.image_block import ImageBlock
from photogrammetry.start_values.relative_orientation import RelativeOrientation, orient_relatively
from photogrammetry.start_values.sightings import Sightings
from rig.errors import BadInputError

_MIN_COMMON = 5
_ORIENTED = 16  # pairs whose relative orientation is computed
_TRIED = 3  # pairs from which a trial block is grown,
_TRIED_IF_CLEAR = 2  # where the first has a single solution
_TRIAL_IMAGES = 4
_ENOUGH_COMMON = 30  # more common points make a pair no better,
_ENOUGH_PARALLAX = 0.5  # rad, nor does a larger angle between the rays


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    first: int
    second: int
    orientation: RelativeOrientation
    score: float


def seed_block(sightings: Sightings, images: list[int]) -> ImageBlock | None:
    """Orient the most promising pair of images.

    Pairs are judged by the number of common points and by the angle between their rays. From the best, trial blocks of
    a few images are grown, one for each possible relative orientation, and the one with the smallest residuals stays.

    Args:
        sightings: what the images saw.
        images: the images to choose from.

    Returns:
        The best trial block; its system is that of one image, with a base of 1. None if no two images have five points
        in common, or none of those that have can be oriented.
    """
    pairs = _pairs(sightings, images)
    trials = [
        (pair, solution) for pair in pairs[:_TRIED] for solution in (pair.orientation, *pair.orientation.alternatives)
    ]
    if not trials:
        return None
    blocks = []
    for pair, solution in trials:
        trial = _block(sightings, pair, solution)
        trial.grow(most_images=_TRIAL_IMAGES)
        blocks.append(trial)
    return min(blocks, key=lambda block: block.residual() / np.sqrt(len(block.cameras)))


def _pairs(sightings: Sightings, images: list[int]) -> list[_Pair]:
    seen = sightings.seen().astype(int)
    counts = seen @ seen.T
    candidates = [(i, j) for i, j in combinations(images, 2) if counts[i, j] >= _MIN_COMMON]
    candidates.sort(key=lambda pair: (-min(int(counts[pair]), _ENOUGH_COMMON), pair))
    found = []
    for first, second in _spread(candidates):
        _, a, b = sightings.common(first, second)
        try:
            orientation = orient_relatively(a, b, sightings.c_of(first), sightings.c_of(second))
        except BadInputError:
            continue  # these two have no solution; others may
        score = min(len(a), _ENOUGH_COMMON) * min(orientation.parallax, _ENOUGH_PARALLAX) * orientation.in_front
        found.append(_Pair(first, second, orientation, score / (1 + len(orientation.alternatives))))
    return sorted(found, key=lambda pair: -pair.score)


def _spread(candidates: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The first candidates, each image at most a few times as long as there are others."""
    chosen: list[tuple[int, int]] = []
    uses: dict[int, int] = {}
    for pair in candidates:
        if len(chosen) < _ORIENTED and all(uses.get(image, 0) < 4 for image in pair):
            chosen.append(pair)
            for image in pair:
                uses[image] = uses.get(image, 0) + 1
    return chosen


def _block(sightings: Sightings, pair: _Pair, solution: RelativeOrientation) -> ImageBlock:
    block = ImageBlock(sightings)
    cameras = solution.cameras(sightings.c_of(pair.first), sightings.c_of(pair.second))
    block.cameras = dict(zip((pair.first, pair.second), cameras, strict=True))
    return block
