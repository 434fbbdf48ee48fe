"""Which views of the target pictures show: parts of the picture, sides, turns about the line of sight, distances.

The same figures say during taking what is still missing, and afterwards what would make a calibration better.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from analysis.targets.detection import Sight
from analysis.targets.pattern import Layout
from analysis.targets.start import start_values
from rig.arrays import Floats, Integers
from rig.phrase import Phrase, phrase

#: The paper's frame was taken in nine pictures.
PICTURES: Final = 9
_CELLS: Final = (8, 6)
_COVERED: Final = 0.7
_ROLLED_DEG: Final = (60.0, 120.0)
_ROLLED: Final = 2  # pictures that are to be turned by 90 degrees
#: 30 to 45 degrees are asked for; with so much on both sides the views differ by enough.
_ASIDE_DEG: Final = 20.0
#: Width of the edges that a good lens in focus shows: others are not blurred for being wider than narrower ones.
SHARP_PX: Final = 0.7
_NEARER: Final = 1.15  # largest over smallest distance


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """What the pictures of a camera show so far.

    Attributes:
        pictures: how many they are.
        cells: (6, 8) corners in each part of the picture, from the top left.
        missing: what to show next, the most urgent first; empty: a calibration can come of them.
    """

    pictures: int
    cells: Integers
    missing: tuple[Phrase, ...]


def views(sights: Sequence[Sight], layout: Layout) -> Views:
    """The views that pictures of one camera show, and those that are missing.

    Args:
        sights: of one camera, of one size, each with corners enough for a pose.
        layout: what was printed.
    """
    if not sights:
        return Views(0, np.zeros(_CELLS[::-1], np.intp), (more_pictures(0),))
    cells = covered_cells(sights)
    poses = list(start_values([("", sight) for sight in sights], layout).poses.values())
    rotations, positions = (np.array([pose[i] for pose in poses]) for i in (1, 0))
    missing: list[Phrase] = []
    if poses:
        missing += [*_missing_sides(rotations), *_missing_rolls(rotations), *_missing_distances(positions)]
    if (covered := float((cells > 0).mean())) < _COVERED:
        text = "show the target where it was not yet: {percent} % of the picture are covered, {wanted} % are needed"
        missing.append(phrase("target_fill", text, percent=round(100 * covered), wanted=round(100 * _COVERED)))
    if len(sights) < PICTURES:
        missing.append(more_pictures(len(sights)))
    return Views(len(sights), cells, tuple(missing))


def more_pictures(count: int) -> Phrase:
    """Says that there are too few pictures."""
    text = "take more pictures: {count} of {wanted} to 15"
    return phrase("target_more", text, count=count, wanted=PICTURES)


def _missing_sides(rotations: Floats) -> Iterator[Phrase]:
    """Sides from which no picture shows the target; `rotations` (n, 3, 3), their frame's third axis its normal."""
    across, up, towards = rotations[:, 2, :].T  # the normal in the system of each camera
    turned, tilted = np.degrees(np.arctan2(across, towards)), np.degrees(np.arctan2(up, towards))
    if not (turned > _ASIDE_DEG).any():
        text = "turn the target by 30 to 45 degrees: its left side towards the camera"
        yield phrase("target_left_near", text)
    if not (turned < -_ASIDE_DEG).any():
        text = "turn the target by 30 to 45 degrees: its right side towards the camera"
        yield phrase("target_right_near", text)
    if not (tilted < -_ASIDE_DEG).any():
        text = "tilt the target by 30 to 45 degrees: its upper side towards the camera"
        yield phrase("target_upper_near", text)
    if not (tilted > _ASIDE_DEG).any():
        text = "tilt the target by 30 to 45 degrees: its lower side towards the camera"
        yield phrase("target_lower_near", text)


def _missing_rolls(rotations: Floats) -> Iterator[Phrase]:
    """Whether a few pictures are turned by 90 degrees against the others."""
    rolled = sum(_is_rolled(rotations[0], other) for other in rotations)
    if (count := min(rolled, len(rotations) - rolled)) < _ROLLED:
        text = "turn the camera or the target by 90 degrees about the line of sight: {count} of {wanted} such pictures"
        yield phrase("target_roll", text, count=count, wanted=_ROLLED)


def _missing_distances(positions: Floats) -> Iterator[Phrase]:
    far = np.linalg.norm(positions, axis=1)
    if far.max() < _NEARER * far.min():
        yield phrase("target_distance", "hold the target nearer once, and once farther away")


def _is_rolled(one: Floats, other: Floats) -> bool:
    """Whether two rotations (3, 3) differ by about 90 degrees about the line of sight."""
    relative = one.T @ other
    roll = float(np.degrees(abs(np.arctan2(relative[1, 0] - relative[0, 1], relative[0, 0] + relative[1, 1]))))
    return _ROLLED_DEG[0] <= roll <= _ROLLED_DEG[1]


def any_rolled(rotations: Floats) -> bool:
    """Whether two of these rotations (n, 3, 3) differ by about 90 degrees about the line of sight."""
    return any(_is_rolled(one, other) for one, other in combinations(rotations, 2))


def covered_cells(sights: Sequence[Sight]) -> Integers:
    """(6, 8) how many corners all pictures of a camera show in each part of the picture, from the top left."""
    width, height = sights[0].size
    places = np.array([(corner.x, corner.y) for sight in sights for corner in sight.corners.values()])
    counts, _, _ = np.histogram2d(
        places[:, 1], places[:, 0], bins=_CELLS[::-1], range=((-0.5, height - 0.5), (-0.5, width - 0.5))
    )
    return np.asarray(counts, np.intp)


def empty_parts(cells: Integers) -> tuple[float, list[str]]:
    """The share of the picture that is covered, and the names of its parts that are not; none if it is enough."""
    covered = float((cells > 0).mean())
    if covered >= _COVERED:
        return covered, []
    names = [f"{v} {h}".strip() for v in ("upper", "middle", "lower") for h in ("left", "", "right")]
    shares = [(cells[2 * i : 2 * i + 2, columns] > 0).mean() for i in range(3)
              for columns in (slice(0, 3), slice(3, 5), slice(5, 8))]  # fmt: skip
    return covered, [name for name, share in zip(names, shares, strict=True) if share < 0.5] or ["edges"]
