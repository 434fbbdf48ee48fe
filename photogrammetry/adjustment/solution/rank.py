"""Rank analysis: finds the unknowns that a network leaves undetermined and names them and the causes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from photogrammetry.adjustment.equations.problem import Problem
from photogrammetry.adjustment.equations.unknowns import State, tied_points
from photogrammetry.adjustment.solution.datum import (
    DatumError,
    FreeDatum,
    datum_points,
    find_free_datum,
    inner_operator,
    similarity_directions,
)
from photogrammetry.adjustment.solution.levelled import levelled, orders_apart
from photogrammetry.adjustment.solution.normals import Normals, SingularError, build_normals, factorise, reduce_points
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.diagnosis import Defect, DefectKind, NotSolvableError
from photogrammetry.network.model import DatumType
from rig.arrays import Floats, Integers
from rig.phrase import Phrase, phrase
from rig.phrases import enumerated

#: Eigenvalues of a unit-diagonal normal matrix below this are zero: rounding leaves about 1e-15. For a point it
#: means rays that meet under less than a millionth of a radian.
_ZERO = 1e-13
#: A reciprocal condition (1-norm) above this needs no closer look.
_HEALTHY = 1e-10
#: An unknown with less than this part of the largest share in a null direction is not named as a cause.
_SHARE = 1e-3
_NAMED = 8  # names in a message, at most; the entry lists all


@dataclass(frozen=True, slots=True, eq=False)
class _Local:
    """A camera, image or point that would be undetermined even if everything else were known."""

    index: int
    columns: Integers  # (w,)
    null: Floats  # (w, defect), scaled


def check_rank(problem: Problem, state: State) -> FreeDatum:
    """Check that the network determines its unknowns (a free network: up to its datum).

    Args:
        problem: the network made ready.
        state: where to linearise.

    Returns:
        The free similarity transformations, which inner constraints fix; none in other networks.

    Raises:
        NotSolvableError: it does not; has all causes and their sizes.
    """
    free, defects = _analysed(problem, state)
    if not defects:
        return free
    alike = levelled(problem, state)
    _, again = _analysed(alike, state)
    if again:
        raise NotSolvableError(tuple(again))
    text = (
        "the sigmas lie {orders} orders of magnitude apart in their effect, and rounding hides what the least accurate "
        "observations determine; give sigmas as large as the errors are"
    )
    said = phrase("defect_sigmas", text, orders=round(orders_apart(problem, alike)))
    raise NotSolvableError((Defect(DefectKind.PARAMETERS, 0, said),))


def _analysed(problem: Problem, state: State) -> tuple[FreeDatum, list[Defect]]:
    """The free similarity transformations, and what is undetermined."""
    normals = build_normals(problem, problem.equations(state))
    free = find_free_datum(problem, normals, state)
    cameras, images, points = _local_defects(problem, normals)
    local = [*cameras, *images, *points]
    free = _beyond(problem, state, normals, free, local)
    defects = [_camera_defect(problem, local) for local in cameras]
    defects += _image_defects(problem, images) + _point_defects(problem, points)
    defects += _datum_defects(problem, state, free)
    defects += _joint_defects(problem, state, normals, free, local)
    return free, defects


def _local_defects(problem: Problem, normals: Normals) -> tuple[list[_Local], list[_Local], list[_Local]]:
    """Cameras, images and points whose own block of the normal matrix is singular."""
    unknowns, split = problem.unknowns, len(normals.n11)

    def kept(columns: Integers) -> list[_Local]:
        found = []
        for index, row in enumerate(columns):
            used = row[row >= 0]
            if len(used) and used[0] < split:
                found += _singular(index, used, normals.n11[used[:, None], used])
        return found

    points = kept(unknowns.point)
    if len(normals.n22):
        suspicious = np.linalg.eigvalsh(normals.n22)[:, 0] < _ZERO
        for place in np.flatnonzero(suspicious):
            index = int(unknowns.eliminated[place])
            points += _singular(index, unknowns.point[index], normals.n22[place])
    return kept(unknowns.camera), kept(unknowns.pose), points


def _singular(index: int, columns: Integers, block: Floats) -> list[_Local]:
    values, vectors = np.linalg.eigh(block)
    null = vectors[:, values < _ZERO]
    return [_Local(index, columns, null)] if null.shape[1] else []


def _beyond(problem: Problem, state: State, normals: Normals, free: FreeDatum, local: Sequence[_Local]) -> FreeDatum:
    """The free motions without those that only move a camera, image or point that is undetermined by itself."""
    if not local or not free.defect:
        return free
    moves = similarity_directions(problem, state, free.centre) @ free.directions / normals.scale[:, None]
    for single in local:
        moves[single.columns] -= single.null @ (single.null.T @ moves[single.columns])
    _, sizes, combos = np.linalg.svd(moves, full_matrices=False)
    return replace(free, directions=free.directions @ combos[sizes > _SHARE * _SHARE].T)


def _camera_defect(problem: Problem, local: _Local) -> Defect:
    camera, defect = problem.network.cameras[local.index], local.null.shape[1]
    share = np.abs(local.null).max(axis=1)
    names = [name for name, part in zip(camera.estimate, share, strict=True) if part > _SHARE]
    images = tuple(image.name for image in problem.network.images if image.camera == local.index)
    if not np.any(problem.camera == local.index):
        text = "camera {camera} has no observations: {names} undetermined; estimate nothing of it"
        said = phrase("defect_camera_unseen", text, camera=camera.name, names=", ".join(names))
    else:
        text = (
            "camera {camera}: {names} cannot be told apart ({size} undetermined); estimate fewer of them or give them "
            "a sigma"
        )
        said = phrase("defect_camera", text, camera=camera.name, names=", ".join(names), size=defect)
    return Defect(DefectKind.PARAMETERS, defect, said, images=images)


def _image_defects(problem: Problem, found: Sequence[_Local]) -> list[Defect]:
    """One entry for all images without observations, one for each other image."""
    names = [problem.network.images[local.index].name for local in found]
    seen = [int(np.sum(problem.image == local.index)) for local in found]
    sizes = [local.null.shape[1] for local in found]
    empty = tuple(name for name, count in zip(names, seen, strict=True) if count == 0)
    defects = []
    if empty:
        size = sum(size for size, count in zip(sizes, seen, strict=True) if count == 0)
        text = "{which} without observations ({size} undetermined): observe points, or drop them"
        said = phrase("defect_images_unseen", text, which=_images(empty), size=size)
        defects.append(Defect(DefectKind.IMAGES, size, said, images=empty))
    for name, count, size in zip(names, seen, sizes, strict=True):
        if count:
            text = (
                "image {image}: {count} observed points do not determine its pose ({size} undetermined); observe more "
                "points in it, or drop it"
            )
            said = phrase("defect_pose", text, image=name, count=count, size=size)
            defects.append(Defect(DefectKind.IMAGES, size, said, images=(name,)))
    return defects


def _point_defects(problem: Problem, found: Sequence[_Local]) -> list[Defect]:
    """One entry for each number of rays: none, one, two or more."""
    rays = np.bincount(problem.point, minlength=len(problem.network.points))
    unseen = "without observations: add at least two rays, or drop them"
    single = "with one ray only, so the depth is open: observe them in a second image, or drop them"
    parallel = "whose rays are parallel: observe them from another place, or drop them"
    reasons = (
        phrase("defect_no_ray", unseen),
        phrase("defect_one_ray", single),
        phrase("defect_parallel_rays", parallel),
    )
    defects = []
    for count in sorted({min(int(rays[local.index]), 2) for local in found}):
        group = [local for local in found if min(int(rays[local.index]), 2) == count]
        names = tuple(problem.network.points[local.index].name for local in group)
        size = sum(local.null.shape[1] for local in group)
        text = "{which} {why} ({size} undetermined)"
        said = phrase("defect_points", text, which=_points(names), why=reasons[count], size=size)
        defects.append(Defect(DefectKind.POINTS, size, said, points=names))
    return defects


def _datum_defects(problem: Problem, state: State, free: FreeDatum) -> list[Defect]:
    if not free.defect:
        return []
    if problem.network.datum.type is not DatumType.INNER:
        parts = _free_parts(free, state)
        text = (
            "no datum: nothing fixes the network's {parts} ({size} undetermined); add control points, a distance, or "
            'take "datum": {{"type": "inner"}}'
        )
        return [Defect(DefectKind.DATUM, free.defect, phrase("defect_datum", text, parts=parts, size=free.defect))]
    points = datum_points(problem.network)
    try:
        inner_operator(problem, state, free, points)
    except DatumError as error:
        names = tuple(problem.network.points[i].name for i in points)
        text = (
            "the datum {which} do not fix the datum ({missing} conditions short); choose at least three that are not "
            "on a line"
        )
        said = phrase("defect_datum_points", text, which=_points(names), missing=error.missing)
        return [Defect(DefectKind.DATUM, error.missing, said, points=names)]
    return []


def _free_parts(free: FreeDatum, state: State) -> Phrase:
    """The free ones of position, rotation and scale in words, with the number of free parameters of each."""
    size = float(np.abs(state.xyz - free.centre).max(initial=0.0)) or 1.0
    shares = free.directions / np.array([size] * 3 + [1.0] * 4)[:, None]  # in units of similar effect on the network
    shares /= np.linalg.norm(shares, axis=0)
    # Dimensions of the combinations without scale, then of those without scale and rotation.
    without_scale = free.defect - _rank(shares[6:])
    translations = free.defect - _rank(shares[3:])
    parts = (
        (translations, phrase("free_position", "position")),
        (without_scale - translations, phrase("free_rotation", "rotation")),
        (free.defect - without_scale, phrase("free_scale", "scale")),
    )
    return enumerated(
        [part if count == 1 else phrase("free_several", "{part} ({count})", part=part, count=count)
         for count, part in parts if count]
    )  # fmt: skip


def _rank(rows: Floats) -> int:
    return int(np.linalg.matrix_rank(rows, tol=1e-6))


def _joint_defects(
    problem: Problem, state: State, normals: Normals, free: FreeDatum, local: Sequence[_Local]
) -> list[Defect]:
    """Combinations of unknowns that are undetermined beside single ones and the datum."""
    moves = similarity_directions(problem, state, free.centre) @ free.directions / normals.scale[:, None]
    normals = _filled(normals, moves, local)
    try:
        if factorise(normals, moves).condition > _HEALTHY:
            return []
    except SingularError:
        pass
    reduced, gain, _ = reduce_points(normals)
    directions, _ = np.linalg.qr(moves[: len(reduced)])
    values, vectors = np.linalg.eigh(reduced + directions @ directions.T)
    null = vectors[:, values < _ZERO]
    if not null.shape[1]:
        return []
    full = np.vstack([null, -gain.reshape(3 * len(gain), len(reduced)) @ null])
    return [_joint_defect(problem, np.abs(full).max(axis=1), null.shape[1])]


def _filled(normals: Normals, moves: Floats, local: Sequence[_Local]) -> Normals:
    """The normal matrix made regular at the local defects; removes these from the datum directions `moves` in place."""
    n11, n22, split = normals.n11.copy(), normals.n22.copy(), len(normals.n11)
    for defect in local:
        fill = defect.null @ defect.null.T
        if defect.columns[0] < split:
            n11[defect.columns[:, None], defect.columns] += fill
        else:
            n22[(defect.columns[0] - split) // 3] += fill
        moves[defect.columns] -= fill @ moves[defect.columns]
    return replace(normals, n11=n11, n22=n22)


def _joint_defect(problem: Problem, share: Floats, size: int) -> Defect:
    network, unknowns = problem.network, problem.unknowns
    taking = np.append(share > _SHARE * share.max(), False)
    images = tuple(network.images[i].name for i in np.flatnonzero(taking[unknowns.pose].any(axis=1)))
    points = tuple(network.points[i].name for i in np.flatnonzero(taking[unknowns.point].any(axis=1)))
    parameters = [
        f"{INTERIOR[unknowns.selection[k]]} of {network.cameras[camera].name}"
        for camera, k in zip(*np.nonzero(taking[unknowns.camera]), strict=True)
    ]
    parts = _parts(problem)
    if len(parts) > 1:
        text = (
            "the network falls into {parts} parts that nothing ties together ({size} undetermined), the smallest of "
            "them {which}; observe common points"
        )
        said = phrase("defect_parts", text, parts=len(parts), size=size, which=_images(parts[0]))
        return Defect(DefectKind.IMAGES, size, said, images=parts[0])
    if parameters:
        text = (
            "{names} cannot be told from the poses and points ({size} undetermined); take images rolled by 90 degrees "
            "and from other distances, estimate fewer parameters, or give them a sigma"
        )
        said = phrase("defect_interior", text, names=", ".join(parameters), size=size)
        return Defect(DefectKind.PARAMETERS, size, said, points, images)
    kind, names = (DefectKind.IMAGES, images) if images else (DefectKind.POINTS, points)
    text = "{which} are not determined together ({size} undetermined); add observations"
    which = _images(names) if images else _points(names)
    return Defect(kind, size, phrase("defect_joint", text, which=which, size=size), points, images)


def _parts(problem: Problem) -> list[tuple[str, ...]]:
    """Names of the images of each connected part of the network, the smallest part first."""
    n_images, n_points = len(problem.network.images), len(problem.network.points)
    ends = tied_points(problem.network)
    rows = np.concatenate([problem.image, n_images + ends[:, 0]])
    columns = n_images + np.concatenate([problem.point, ends[:, 1]])
    size = n_images + n_points
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    seen = np.unique(label[problem.image])
    parts = [tuple(problem.network.images[i].name for i in np.flatnonzero(label[:n_images] == part)) for part in seen]
    return sorted(parts, key=len)


def _images(names: Sequence[str]) -> Phrase:
    if len(names) == 1:
        return phrase("named_image", "image {name}", name=names[0])
    return phrase("named_images", "images {names}", names=_listed(names))


def _points(names: Sequence[str]) -> Phrase:
    if len(names) == 1:
        return phrase("named_point", "point {name}", name=names[0])
    return phrase("named_points", "points {names}", names=_listed(names))


def _listed(names: Sequence[str]) -> str | Phrase:
    listed, more = ", ".join(names[:_NAMED]), len(names) - _NAMED
    return listed if more <= 0 else phrase("named_more", "{names} and {more} more", names=listed, more=more)
