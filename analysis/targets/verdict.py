"""Says in words what a calibration from pictures is good for, and which pictures would make it better."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from analysis.targets.network_of import Picture
from analysis.targets.pattern import Layout, target_of
from analysis.targets.views import PICTURES, SHARP_PX, any_rolled, covered_cells, empty_parts, more_pictures
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.camera_model import Lens, linearise, undistort
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

#: What measuring jumps asks for (paper, section 4): 20 mm in the 20 m that a picture is wide.
WANTED: Final = 1000.0
#: The lens may take so much of that: with a third the whole error grows by a twentieth.
_SHARE: Final = 1.0 / 3.0
FEWEST_PICTURES: Final = 3
_ASIDE_DEG: Final = 30.0
_ONE_POSE_DEG: Final = 3.0
_ONE_POSE_NEARER: Final = 1.05
_BLURRED: Final = 1.6  # times the usual width of edges
_UNSHARP_PX: Final = 2.0  # width of edges
_RESIDUAL_PX: Final = 0.3
_PRINTED: Final = 0.005  # of its length, that a print may be off
_BENT: Final = 1e-3  # of the board's length
_GRID: Final = (9, 7)


@dataclass(frozen=True, slots=True)
class CameraVerdict:
    """What a camera's calibration is good for.

    Attributes:
        camera: its name.
        pictures: how many it has.
        lens_px: rms over the picture of the sigma of image places that the interior orientation leaves, without what a
            turn of the camera takes up.
        one_to: width of the picture over `lens_px`.
        good: whether it is good enough for 1:1000.
        said: the verdict in a sentence.
        advice: which pictures would make it better, a sentence each.
    """

    camera: str
    pictures: int
    lens_px: float
    one_to: float
    good: bool
    said: Phrase
    advice: tuple[Phrase, ...]

    @property
    def words(self) -> str:
        """The verdict in English."""
        return self.said.text


def require_poses(pictures: Sequence[Picture], rotations: Floats, positions: Floats) -> None:
    """Refuse cameras whose pictures cannot tell the lens from the pose.

    Args:
        pictures: with their corners.
        rotations: (n, 3, 3) of the pictures.
        positions: (n, 3) of the pictures, from the middle of the frame.

    Raises:
        BadInputError: too few pictures, or all of one pose.
    """
    for camera in dict.fromkeys(picture.camera for picture in pictures):
        mine = [k for k, picture in enumerate(pictures) if picture.camera == camera]
        what = "1 picture shows" if len(mine) == 1 else f"{len(mine)} pictures show"
        if len(mine) < FEWEST_PICTURES:
            raise BadInputError(
                f"camera {camera}: {what} the targets, and no calibration comes of that; take {PICTURES} to 15, from "
                "all sides, some with the camera turned by 90 degrees"
            )
        turns = [np.degrees(_turn(rotations[i].T @ rotations[j])) for i, j in combinations(mine, 2)]
        far = np.linalg.norm([positions[k] for k in mine], axis=1)
        if max(turns) < _ONE_POSE_DEG and far.max() < _ONE_POSE_NEARER * far.min():
            raise BadInputError(
                f"camera {camera}: all {len(mine)} pictures are of one pose; move the camera or the target between "
                "pictures, to all sides, and turn the camera by 90 degrees for some"
            )


def _turn(rotation: Floats) -> float:
    return float(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))


def verdicts(a: Adjustment, pictures: Sequence[Picture]) -> list[CameraVerdict]:
    """The verdict on each camera of a calibration.

    Args:
        a: the adjusted network.
        pictures: those of the network.
    """
    return [_verdict(a, i, [picture for picture in pictures if picture.camera == camera.name])
            for i, camera in enumerate(a.network.cameras)]  # fmt: skip


def _verdict(a: Adjustment, camera: int, pictures: Sequence[Picture]) -> CameraVerdict:
    name, size = a.network.cameras[camera].name, pictures[0].sight.size
    lens = float(np.sqrt(np.mean(lens_sigmas(a, camera, size)[1] ** 2)))
    one_to = size[0] / lens if lens > 0.0 else np.inf
    good = one_to * _SHARE >= WANTED
    return CameraVerdict(
        name,
        len(pictures),
        lens,
        one_to,
        good,
        _said(name, lens, one_to, good=good),
        tuple(_advice(a, camera, pictures)),
    )


def _said(name: str, lens: float, one_to: float, *, good: bool) -> Phrase:
    wanted, needed, known = f"{WANTED:.0f}", round(WANTED / _SHARE), round(_rounded(one_to))
    lens_px = float(f"{lens:.2g}")
    if good:
        text = (
            "camera {camera}: good enough for 1:{wanted}: the lens is known to {lens_px:g} px (1:{one_to} of the "
            "picture's width; 1:{needed} is needed)"
        )
        return phrase("target_good", text, camera=name, wanted=wanted, lens_px=lens_px, one_to=known, needed=needed)
    text = (
        "camera {camera}: NOT good enough for 1:{wanted}: the lens is known to {lens_px:g} px (1:{one_to} of the "
        "picture's width; 1:{needed} is needed)"
    )
    return phrase("target_not_good", text, camera=name, wanted=wanted, lens_px=lens_px, one_to=known, needed=needed)


def _rounded(value: float) -> float:
    """With two digits."""
    return float(f"{min(value, 1e9):.2g}")


def lens_sigmas(a: Adjustment, camera: int, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """What the uncertainty of a camera's interior orientation means in its picture.

    Args:
        a: the adjusted network.
        camera: its index.
        size: of its pictures, px.

    Returns:
        Places (n, 2), metric, and the sigma (n,) px at each of them, without what a turn of the camera takes up.
    """
    half = (np.array(size) - 1.0) / 2.0
    x, y = (np.linspace(-half[k], half[k], _GRID[k]) for k in (0, 1))
    places = np.column_stack([part.ravel() for part in np.meshgrid(x, y)])
    interior = a.state.interior[camera]
    balance = np.asarray(a.network.cameras[camera].balance)
    one = Lens(interior, balance, np.asarray(False))
    ideal = undistort(one, places)
    inside = np.isfinite(ideal).all(axis=1)
    places, ideal = places[inside], ideal[inside]
    rays = np.column_stack((ideal, np.full(len(ideal), -interior[0])))
    slopes = linearise(
        Lens(interior[None], balance[None], np.zeros(1, dtype=bool)), np.eye(3)[None], np.zeros((1, 3)), rays, places
    )
    columns = a.problem.unknowns.camera[camera]
    known = columns >= 0
    by_lens = np.asarray(slopes.by_interior, float)[..., a.problem.unknowns.selection[known]].reshape(-1, known.sum())
    by_turn = np.asarray(slopes.by_pose, float)[..., 3:].reshape(-1, 3)
    by_lens -= by_turn @ np.linalg.lstsq(by_turn, by_lens, rcond=None)[0]
    variance = np.einsum("ij,jk,ik->i", by_lens, a.covariance(columns[known]), by_lens)
    return places, np.sqrt(np.maximum(variance, 0.0).reshape(-1, 2).mean(axis=1))


def _advice(a: Adjustment, camera: int, pictures: Sequence[Picture]) -> Iterator[Phrase]:
    if len(pictures) < PICTURES:
        yield more_pictures(len(pictures))
    covered, empty = empty_parts(covered_cells([picture.sight for picture in pictures]))
    if empty:
        text = "fill the picture: targets cover {percent}% of it; show them in its {parts} part"
        yield phrase("target_parts", text, percent=round(100 * covered), parts=", ".join(empty))
    mine = [k for k, image in enumerate(a.network.images) if image.camera == camera]
    rotations = a.state.rotation[mine]
    pairs = list(combinations(range(len(mine)), 2))
    aside = max((_between(rotations[i][:, 2], rotations[j][:, 2]) for i, j in pairs), default=0.0)
    if aside < _ASIDE_DEG:
        text = (
            "take pictures from more to the side, also from above and below: the views differ by {aside} degrees "
            "at most, {least} to 60 are good"
        )
        yield phrase("target_aside", text, aside=round(aside), least=round(_ASIDE_DEG))
    if not any_rolled(rotations):
        text = "turn the camera by 90 degrees for two more pictures: principal point and pose are not apart"
        yield phrase("target_turn_camera", text)
    usual = float(np.median([picture.sight.blur for picture in pictures]))
    if usual > _UNSHARP_PX:
        text = "focus the lens: edges are {width} px wide in all pictures"
        yield phrase("target_unsharp", text, width=round(usual, 1))
    for picture in pictures:
        if picture.sight.blur > _BLURRED * max(usual, SHARP_PX):
            text = "take {picture} again: blurred (edges {width} px wide, usual {usual})"
            width, wide = round(picture.sight.blur, 1), round(usual, 1)
            yield phrase("target_blurred", text, picture=picture.name, width=width, usual=wide)
    residuals = a.image_residuals()[a.problem.camera == camera]
    rms = float(np.sqrt(np.mean(residuals**2)))
    if rms > _RESIDUAL_PX:
        text = (
            "corners are off by {rms} px (rms), which is more than measuring errors: let nothing move during an "
            "exposure, and use a rigid target and a global shutter"
        )
        yield phrase("target_residuals", text, rms=round(rms, 1))


def _between(one: Floats, other: Floats) -> float:
    return float(np.degrees(np.arccos(np.clip(one @ other, -1.0, 1.0))))


def _side_ratios(layout: Layout, code: int, place: Mapping[str, Floats]) -> Iterator[float]:
    """The sides of a target over their nominal length."""
    corners = layout.corners(code)
    for one, other in zip(corners, (*corners[1:], corners[0]), strict=True):
        if one is not None and other is not None and one in place and other in place:
            yield float(np.linalg.norm(place[one] - place[other])) / layout.side_mm(code)


def print_notes(a: Adjustment, layout: Layout, *, scaled: bool) -> list[str]:
    """What the adjusted corners say of the prints: their scale, if a distance was measured, and how the board bends."""
    place = {point.name: xyz for point, xyz in zip(a.network.points, a.state.xyz, strict=True)}
    notes = []
    ratios = [ratio for code in layout.codes for ratio in _side_ratios(layout, code, place)]
    scale = float(np.median(ratios)) if ratios else 1.0
    if scaled and abs(scale - 1.0) > _PRINTED:
        notes.append(
            f"the prints have {scale:.1%} of their nominal size (printed to fit the page?): nothing in the calibration "
            "depends on it, but take no length from their sheets"
        )
    board = np.array([xyz for name, xyz in place.items() if target_of(name) == "board"])
    if len(board) >= 4:
        centred = board - board.mean(axis=0)
        off = float(np.abs(centred @ np.linalg.svd(centred, full_matrices=False)[2][2]).max())
        if off > _BENT * float(np.ptp(centred, axis=0).max()):
            notes.append(
                f"the board bends by {off:.2g} mm{'' if scaled else ' (at its nominal size)'}: do not use --flat"
            )
    return notes
