"""The template of a thing: its grey values in one image, and which share of each pixel belongs to it."""

from dataclasses import dataclass, field

import cv2
import numpy as np

from analysis.scene.static_image import GreyImage
from rig.arrays import Floats

_FRONT = 4.0  # sigmas of the difference to the background: a pixel of something in front
_WEIGHT_SPREAD = 0.7  # of the half size: standard deviation of the weights around the thing
_WEIGHT_LEAST = 0.05  # weight below which a pixel is left out


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image to look in.

    Attributes:
        grey: (rows, columns) grey values, in the light of the background.
        behind: (rows, columns) the static background there; None if it is not known.
        noise: standard deviation of a grey value.
        shift: (2,) px from where the camera shows things when it stands still to where it shows them now.
    """

    grey: GreyImage
    behind: GreyImage | None
    noise: float
    shift: Floats = field(default_factory=lambda: np.zeros(2))

    def holds(self, xy: Floats, margin: float) -> bool:
        """Whether a place lies in the image, so many px from its border."""
        last = np.array(self.grey.shape[::-1]) - 1
        return bool((xy >= margin).all() and (xy <= last - margin).all())


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """How a thing looked in one image, k pixels around it.

    Attributes:
        places: (k, 2) px from the place of the thing.
        grey: (k,) grey values.
        behind: (k,) the static background there; 0 if it is not known.
        share: (k,) of the pixel that belongs to the thing.
        weight: (k,) how much the pixel counts.
        half: px to each side.
        noise: standard deviation of a grey value.
    """

    places: Floats
    grey: Floats
    behind: Floats
    share: Floats
    weight: Floats
    half: int
    noise: float


def template(picture: Picture, xy: Floats, half: int) -> Template:
    """The template of the thing at a place (2,) px, with so many px to each side; the image may end there."""
    centre = np.rint(xy).astype(int)
    rows, columns = picture.grey.shape
    y, x = np.mgrid[centre[1] - half : centre[1] + half + 1, centre[0] - half : centre[0] + half + 1]
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    at = np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)
    grey = picture.grey[at]
    share, weight = np.ones(grey.shape), inside.astype(float)
    behind = np.zeros(grey.shape)
    if picture.behind is not None:
        behind = picture.behind[at].astype(float)
        share, near = _share(grey - behind, picture.noise)
        weight = weight * near
    places = np.column_stack((x.ravel() - xy[0], y.ravel() - xy[1]))
    weight *= np.exp(-(((x - xy[0]) ** 2 + (y - xy[1]) ** 2) / (2 * (_WEIGHT_SPREAD * half) ** 2)))
    chosen = weight.ravel() > _WEIGHT_LEAST
    grey, behind, share, weight = (part.ravel()[chosen] for part in (grey, behind, share, weight))
    return Template(places[chosen], grey.astype(float), behind, share, weight, half, picture.noise)


def _share(difference: Floats, noise: float) -> tuple[Floats, Floats]:
    """Share of each pixel that belongs to things in front, and the pixels that show these or their outline."""
    off = np.abs(difference).astype(np.float32)
    front = (off > _FRONT * noise).astype(np.uint8)
    front = np.asarray(cv2.morphologyEx(front, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)), np.uint8)
    full = cv2.dilate(off, np.ones((3, 3), np.uint8))
    share = np.where(front > 0, np.minimum(off / np.maximum(full, 1e-3), 1.0), 0.0)
    inner = cv2.erode(front, np.ones((3, 3), np.uint8)) > 0
    near = cv2.dilate(front, np.ones((5, 5), np.uint8)) > 0
    return np.where(inner, 1.0, share), near.astype(float)
