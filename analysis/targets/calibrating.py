"""From pictures of targets to calibrated cameras (paper, step 1): one bundle adjustment of all cameras' pictures."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from analysis.targets.bending import unbent
from analysis.targets.mixing import adjusted_or_none, of_one_lens
from analysis.targets.network_of import MeasuredDistance, Picture, network_of
from analysis.targets.pattern import Layout, target_of
from analysis.targets.verdict import CameraVerdict, print_notes, require_poses, verdicts
from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.gross_errors.blunders import BlunderKind, Removed
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.network.diagnosis import NotConvergedError
from photogrammetry.network.model import Network
from photogrammetry.network.selection import only_points
from photogrammetry.procedures.calibration import Calibration, calibrate

#: A target moved if its residuals are so many times the others', and others of its network shrink without it.
_TIMES: Final = 4.0
_TARGETS_LEFT: Final = 3


@dataclass(frozen=True, slots=True, eq=False)
class PictureCalibration:
    """Calibrated cameras, and what led to them.

    Attributes:
        network: as it was adjusted, with start values.
        calibration: the free adjustment.
        pictures: those of the network.
        verdicts: one for each camera.
        notes: what was left out and why, and what the prints are like.
    """

    network: Network
    calibration: Calibration
    pictures: tuple[Picture, ...]
    verdicts: tuple[CameraVerdict, ...]
    notes: tuple[str, ...]


def calibrate_pictures(
    pictures: Sequence[Picture], layout: Layout, distances: Sequence[MeasuredDistance] = (), *, flat: bool = False
) -> PictureCalibration:
    """Calibrate the cameras of pictures of one rigid frame or board.

    Args:
        pictures: with their corners.
        layout: what was printed.
        distances: measured ones, for the scale of the frame.
        flat: the board is flat.

    Raises:
        BadInputError: pictures that no calibration comes of; says which to take.
        NotSolvableError, NotConvergedError, RefusedError: as the adjustment.
    """
    network, notes = network_of(pictures, layout, distances, flat=flat)
    start = state_of(network)
    require_poses(_used(pictures, network), start.rotation, start.position - start.xyz.mean(axis=0))
    network, odd = _with_better_start(network)
    network, contradicting = of_one_lens(network)
    pictures = _used(pictures, network)
    network, moved = _without_moved(network)
    network = unbent(network, pictures)
    calibration = calibrate(network)
    a = calibration.outcome.adjustment
    return PictureCalibration(
        network,
        calibration,
        pictures,
        tuple(verdicts(a, pictures)),
        (
            *notes,
            *odd,
            *contradicting,
            *moved,
            *_hidden(calibration.outcome.removed),
            *print_notes(a, layout, scaled=bool(distances)),
        ),
    )


def _used(pictures: Sequence[Picture], network: Network) -> tuple[Picture, ...]:
    names = {image.name for image in network.images}
    return tuple(picture for picture in pictures if picture.name in names)


def _with_better_start(network: Network) -> tuple[Network, list[str]]:
    """The network adjusted by c alone of the interior orientations: from there the others converge, too.

    Returns:
        The network, and a line for each picture that contradicts all others so much that nothing converges with it.
    """
    simple = replace(
        network,
        cameras=tuple(replace(one, estimate=("c",), sigma={"c": one.sigma["c"]}) for one in network.cameras),
    )
    a = adjusted_or_none(simple)
    if a is None:
        smaller, odd = of_one_lens(network)
        if odd:
            network, more = _with_better_start(smaller)
            return network, [*odd, *more]
        raise NotConvergedError(
            "the pictures contradict each other: targets were moved on the frame between pictures, or a folder holds "
            "pictures of several cameras or zooms; take them again with all targets fixed"
        )
    better = _at(simple, a)
    cameras = (
        replace(one, interior=found.interior) for one, found in zip(network.cameras, better.cameras, strict=True)
    )
    return replace(better, cameras=tuple(cameras)), []


def _without_moved(network: Network) -> tuple[Network, list[str]]:
    """The network, at its adjusted values, without targets that did not stay where they were on the frame."""
    notes: list[str] = []
    while True:
        a = adjust_once(network, state_of(network))
        sizes = _residuals_by_target(network, a)
        worst = max(sizes, key=lambda name: sizes[name])
        others = [size**2 for name, size in sizes.items() if name != worst]
        few = len(sizes) <= _TARGETS_LEFT
        if few or worst == "board" or sizes[worst] < _TIMES * float(np.sqrt(np.mean(others))):
            return _at(network, a), notes
        stays = np.array([target_of(point.name) != worst for point in network.points])
        network = only_points(network, stays)
        notes.append(
            f"target {worst[1:]} is left out: it moved on the frame between the pictures; fix all targets to one rigid "
            "thing"
        )


def _hidden(removed: Sequence[Removed]) -> list[str]:
    """A line for each target of which single corners were taken out in single pictures."""
    of_target = defaultdict[str, list[str]](list)
    for gone in removed:
        if gone.blunder.suspect.kind is BlunderKind.IMAGE:
            o, k = gone.network.observations, gone.blunder.suspect.index
            name = gone.network.points[o.point[k]].name
            of_target[target_of(name)].append(f"{name} in {gone.network.images[o.image[k]].name}")
    return [
        f"{'the board' if target == 'board' else f'target {target[1:]}'}: what does not fit its other pictures is left "
        f"out: {', '.join(corners)}; take care that nothing hides a part of it, such as the edge of another target"
        for target, corners in of_target.items()
    ]


def _residuals_by_target(network: Network, a: Adjustment) -> dict[str, float]:
    """The residuals of each target over their sigmas: rms over pictures of what half of its corners there exceed.

    A target that moved is off with all its corners; one that another target hides in part is not.
    """
    v = np.square(a.image_residuals() / a.problem.sigma).sum(axis=1)
    seen = defaultdict[tuple[str, int], list[float]](list)
    for point, image, size in zip(a.problem.point.tolist(), a.problem.image.tolist(), v.tolist(), strict=True):
        seen[target_of(network.points[point].name), image].append(size)
    of_target = defaultdict[str, list[float]](list)
    for (target, _), sizes in seen.items():
        of_target[target].append(sorted(sizes)[(len(sizes) - 1) // 2])
    return {target: float(np.sqrt(np.mean(sizes))) for target, sizes in of_target.items()}


def _at(network: Network, a: Adjustment) -> Network:
    """The network with adjusted values to start from."""
    state: State = a.state
    return replace(
        network,
        cameras=tuple(
            replace(one, interior=values) for one, values in zip(network.cameras, state.interior, strict=True)
        ),
        images=tuple(
            replace(image, position=position, rotation=rotation)
            for image, position, rotation in zip(network.images, state.position, state.rotation, strict=True)
        ),
        points=tuple(replace(point, xyz=xyz) for point, xyz in zip(network.points, state.xyz, strict=True)),
    )
