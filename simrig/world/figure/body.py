"""The body of the simulated jumper: its joints, and the capsules (hulls of two balls) that it is made of.

The capsules decide, for images and truth alike, what hides what: the nearer one hides the farther one, by the distance
of their middles. A marker is painted on its carriers, which never hide it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.arrays import Floats
from simrig.world.jumper import Pose
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, Jumper

SKI_RADIUS_M = 0.04  #: a ski is a thin capsule, whose middle line is the ski line in every view
SKI_PIECES = 5
SUIT_LIGHT = 1.5  #: how much brighter a limb is where the sky lights it
BOOT, GLOVE, FACE = 38.0, 120.0, 150.0
THIGH_M = SHANK_M = 0.45
_HIP_ASIDE_M, _SHOULDER_ASIDE_M, _HAND_ASIDE_M = 0.11, 0.19, 0.3
_ANKLE_UP_M = 0.1
_FAR_LIGHT = 0.8  #: the side of the body away from the camera is darker


@dataclass(frozen=True, slots=True)
class Part:
    """A capsule.

    Attributes:
        a: centre of one ball, m, shape (3,).
        b: centre of the other; may equal `a`.
        radius_a: m.
        radius_b: m.
        radiance: of its surface.
        lit: whether the sky lights a stripe along it.
        carries: indices of the markers that are painted on it.
    """

    a: Floats
    b: Floats
    radius_a: float
    radius_b: float
    radiance: float
    lit: bool = False
    carries: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Ordered:
    """Something to paint: a part, or the marker with this index."""

    part: Part | None
    marker: int = -1


def joints(pose: Pose, half_ski_m: float) -> Floats:
    """All points of the figure, m, shape (19, 3).

    P1..P4, neck, then for the right and for the left half: tip and tail of the ski, ankle, knee, hip, shoulder, hand.
    """
    helmet, hip = pose.markers[0], pose.markers[1]
    forward, side, up = pose.axes
    trunk = helmet - hip
    neck = hip + 0.76 * trunk
    points = [*pose.markers, neck]
    for i, outward in ((0, -side), (1, side)):
        middle, along = pose.markers[2 + i], pose.skis[i]
        ankle = middle + _ANKLE_UP_M * up
        thigh = hip + _HIP_ASIDE_M * outward
        hand = hip + _HAND_ASIDE_M * outward - 0.12 * trunk + 0.02 * up
        points += [middle + half_ski_m * along, middle - half_ski_m * along]
        points += [ankle, _knee(ankle, thigh, forward), thigh, neck + _SHOULDER_ASIDE_M * outward, hand]
    return np.stack(points)


def parts(points: Floats, jumper: Jumper, near: int) -> list[Part]:
    """The capsules of a figure, in no order.

    Args:
        points: its joints, as `joints` gives them.
        jumper: gives the radiances.
        near: side of the body towards the camera, 0 right, 1 left.
    """
    helmet, hip, neck = points[0], points[1], points[4]
    body = [
        Part(hip, neck, 0.15, 0.19, jumper.suit, lit=True, carries=(0, 1)),
        Part(neck, helmet, 0.06, 0.08, FACE, carries=(0,)),
        Part(helmet, helmet, 0.145, 0.145, jumper.patch, carries=(0,)),
    ]
    for i in (0, 1):
        tip, tail, ankle, knee, thigh, shoulder, hand = points[5 + 7 * i : 12 + 7 * i]
        suit = jumper.suit * (1.0 if i == near else _FAR_LIGHT)
        foot = (2 + i,)
        body += [
            Part(ankle, knee, 0.07, 0.085, suit, lit=True, carries=foot),
            Part(knee, thigh, 0.085, 0.12, suit, lit=True, carries=(1,)),
            Part(ankle, ankle, 0.09, 0.09, BOOT, carries=foot),
            Part(shoulder, hand, 0.075, 0.05, suit, lit=True),
            Part(hand, hand, 0.06, 0.06, GLOVE),
        ]
        ends = np.linspace(tail, tip, SKI_PIECES + 1)
        for k in range(SKI_PIECES):
            carries = foot if k == SKI_PIECES // 2 else ()
            body.append(Part(ends[k], ends[k + 1], SKI_RADIUS_M, SKI_RADIUS_M, jumper.skis, carries=carries))
    return body


def in_order(body: list[Part], markers: Floats, projection: Projection) -> list[Ordered]:
    """Parts and markers, shape (4, 3), from far to near; each marker after the parts that carry it."""
    middles = np.array([(part.a + part.b) / 2 for part in body])
    far = projection.distance(middles)
    things = [(float(distance), 1, Ordered(part)) for distance, part in zip(far, body, strict=True)]
    for i, own in enumerate(projection.distance(markers)):
        carriers = [float(distance) for distance, part in zip(far, body, strict=True) if i in part.carries]
        things.append((min(float(own), *carriers), 0, Ordered(None, i)))
    return [thing for _, _, thing in sorted(things, key=lambda thing: (-thing[0], -thing[1]))]


def outlines(shapes: Sequence[Part], projection: Projection) -> tuple[Floats, Floats]:
    """Images of parts: centres of both balls, px, shape (n, 2, 2), and their radii, px, shape (n, 2)."""
    ends = np.array([(part.a, part.b) for part in shapes]).reshape(len(shapes), 2, 3)
    radii = np.array([(part.radius_a, part.radius_b) for part in shapes]).reshape(len(shapes), 2)
    return projection.pixels(ends), radii * projection.c / projection.distance(ends)


def stripe(radiance: float) -> float:
    """Radiance of the stripe along a limb that the sky lights."""
    return min(SUIT_LIGHT * radiance, BRIGHTEST)


def _knee(ankle: Floats, hip: Floats, forward: Floats) -> Floats:
    """Knee between ankle and hip; it bends forward as far as the lengths of shank and thigh ask."""
    leg = hip - ankle
    length = math.sqrt(leg @ leg)
    aside = forward - (forward @ leg) / length**2 * leg
    bend = math.sqrt(max(0.0, SHANK_M * THIGH_M - (length / 2) ** 2))
    return np.asarray(ankle + leg / 2 + bend * aside / math.sqrt(aside @ aside))
