"""Where one image may show a tracked thing: places that match its template, or what was measured automatically."""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.digitizing.following.points.appearance import CORRELATED, Match, match, search
from analysis.digitizing.following.points.motion import UNSTEADY, Observation
from analysis.digitizing.following.points.thing_template import Picture, Template, template
from analysis.measurements.model import PointMeasurement
from rig.arrays import Floats
from rig.phrase import NOTHING, Phrase, phrase

LOOK_P: Final = 1e-5  #: probability of a true thing to lie outside the ellipse in which it is searched
_PEAKS = 3  # of the correlation that are matched
_HALF_M, _HALF_PX = 0.2, (6, 20)  # to each side of a template, and its limits
_WORST_PX = 1.5  # sigma of a match
_BORDER_PX = 4.0  # from the border of the image a thing is said to leave it
_NEAR_PX = 2.5  # a thing that cannot be farther from its predicted place is matched from there at once
_SAME_PX = 0.5  # two matches that are nearer than this are one
_NO_STEP = np.zeros((2, 2))


class Origin(StrEnum):
    """Where a tracked place comes from."""

    TRACKED = "tracked"
    AUTOMATIC = "automatic"


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """What the matches of one camera refer to.

    The template stays the marked one as long as it matches, so that errors do not add up. When it matches no more, the
    last image in which it did takes its place.

    Attributes:
        template: in use.
        covariance: (2, 2) px^2 of its place against the thing.
        affine: (2, 2) A of the last match.
        picture: image of the last match, or of the mark.
        last: (2,) place of the last match in it, px.
        covariance_of_last: (2, 2) px^2 of that match against the template.
        half: px, size of templates.
    """

    template: Template
    covariance: Floats
    affine: Floats
    picture: Picture
    last: Floats
    covariance_of_last: Floats
    half: int

    @classmethod
    def at_mark(cls, picture: Picture, xy: Floats, covariance: Floats, px_per_m: float) -> "Anchor":
        """The anchor at a mark (2,) px by hand of covariance (2, 2), where 1 m is so large."""
        half = int(np.clip(round(_HALF_M * px_per_m), *_HALF_PX))
        return cls(template(picture, xy, half), covariance, np.eye(2), picture, xy, _NO_STEP, half)

    def younger(self) -> "Anchor":
        """The anchor at the last match."""
        made = template(self.picture, self.last, self.half)
        total = self.covariance + self.covariance_of_last
        return replace(self, template=made, covariance=total, affine=np.eye(2), covariance_of_last=_NO_STEP)

    def matched(self, picture: Picture, found: Match) -> "Anchor":
        """The same after a match: the thing turns, and its place on the template drifts."""
        return replace(
            self,
            covariance=self.covariance + found.drift,
            affine=found.affine,
            picture=picture,
            last=found.xy,
            covariance_of_last=found.covariance,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A place at which a camera may see the thing.

    Attributes:
        observation: for the filter.
        sigma: (2,) px, of the place against the thing.
        origin: where it comes from.
        score: of the match, see `appearance.Match`; of several in one image the least is the likeliest.
        anchor: of the camera, if this is the thing; None: it stays as it is.
        step: (2, 2) px^2 by which the offset of the camera is less certain then.
    """

    observation: Observation
    sigma: Floats
    origin: Origin
    score: float = 0.0
    anchor: Anchor | None = None
    step: Floats = field(default_factory=_NO_STEP.copy)


def of_automatic(measured: PointMeasurement, predicted: tuple[Floats, Floats], shift: Floats) -> list[Candidate]:
    """What was measured automatically, if it agrees with what is predicted.

    Args:
        measured: in an image.
        predicted: place (2,) and its covariance (2, 2), px, when the camera stands still.
        shift: (2,) px by which the image is off.
    """
    off = measured.xy - shift - predicted[0]
    if off @ np.linalg.solve(predicted[1] + measured.covariance, off) > chdtri(2, LOOK_P):
        return []
    sigma = np.sqrt(np.diagonal(measured.covariance))
    observation = Observation(measured.xy, measured.covariance + UNSTEADY, shift, has_offset=False)
    return [Candidate(observation, sigma, Origin.AUTOMATIC)]


def of_images(
    anchor: Anchor, picture: Picture, predicted: tuple[Floats, Floats], camera: str
) -> tuple[list[Candidate], Phrase]:
    """Places that match a camera's template, or that of its last match; if there are none, why.

    Args:
        anchor: of the camera.
        picture: its image.
        predicted: place (2,) and its covariance (2, 2), px, when the camera stands still.
        camera: its name.
    """
    xy, covariance = predicted[0] + picture.shift, predicted[1]
    if not (np.isfinite(xy).all() and picture.holds(xy, _BORDER_PX)):
        return [], phrase("hand_place_outside", "{camera} does not show its place", camera=camera)
    best = -1.0
    for younger in (False, True):
        of = anchor.younger() if younger else anchor
        matches = _matches(of, picture, xy, covariance)
        good = [found for found in matches if _is_good(found)]
        if good:
            step = of.covariance - anchor.covariance
            return [_candidate(of, picture, found, step) for found in good], NOTHING
        best = max([best, *(found.correlation for found in matches)])
    if best < 0:
        return [], phrase("hand_no_match", "{camera} shows nothing that could be matched", camera=camera)
    return [], phrase(
        "hand_unlike",
        "{camera} shows nothing that looks like it (correlation {correlation:.2f})",
        camera=camera,
        correlation=best,
    )


def _matches(anchor: Anchor, picture: Picture, xy: Floats, covariance: Floats) -> list[Match]:
    """Matches near a predicted place, good and poor; none of a template in which nothing stands out."""
    if not len(anchor.template.places):
        return []
    gate = float(chdtri(2, LOOK_P))
    if np.sqrt(gate * np.linalg.eigvalsh(covariance)[-1]) < _NEAR_PX:
        near = match(anchor.template, picture, xy, anchor.affine)
        if near is not None and _is_good(near):
            return [near]
    starts = search(anchor.template, picture, xy, covariance, anchor.affine, gate, _PEAKS)
    found: list[Match] = []
    for start in starts:
        matched = match(anchor.template, picture, start, anchor.affine)
        if matched is not None and all(np.hypot(*(matched.xy - other.xy)) > _SAME_PX for other in found):
            found.append(matched)
    return found


def _is_good(found: Match) -> bool:
    return found.correlation >= CORRELATED and _worst(found) <= _WORST_PX


def _worst(found: Match) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(found.covariance)[-1]))


def _candidate(anchor: Anchor, picture: Picture, found: Match, step: Floats) -> Candidate:
    sigma = np.sqrt(np.diagonal(anchor.covariance + found.drift + found.covariance))
    drifted = step + found.drift
    observation = Observation(found.xy, found.covariance + drifted + UNSTEADY, picture.shift)
    after = anchor.matched(picture, found)
    return Candidate(observation, sigma, Origin.TRACKED, found.score, after, drifted)
