"""Centre of mass of a jumper with boots and skis, from twelve landmarks of the body, helmet and bindings.

Two tables tell which share of the body's mass each segment has, and where on it the centre is:

- de Leva (1996), J. Biomech. 29:1223-1230, table 4, men; gamma-ray scans of 100 young men by Zatsiorsky, adjusted to
  joints;
- Dempster (1955), WADC TR 55-159, as adapted by Winter (2009), Biomechanics and Motor Control of Human Movement,
  table 4.1; eight cadavers.

Two kinds of uncertainty are kept apart, since more cameras make only the first one smaller:

- *measurement*: of the landmarks;
- *table*: this athlete is not the table's man. Masses and centres scatter from person to person as Clauser, McConville
  and Young (1969), AMRL-TR-69-70, found. Helmet and bindings stand for points that they are not. And the tables define
  segments differently (a thigh has 14 % of the mass in one and 10 % in the other): half of the difference of what both
  give counts as one more sigma. It is the same in all pulses of a jump, except for the posture, so it hardly touches
  velocities.

The head is taken to be at the helmet marker P1, which is near the ear canal, where Winter's table has the centre of
head and neck; each foot and boot half-way from the ankle to the binding marker; each ski at its binding marker.
P1..P4 alone do not tell where trunk, arms and legs are: no centre of mass follows from them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from rig.arrays import Floats
from rig.errors import BadInputError

#: The twelve landmarks: joint centres, as well as they can be seen; the ankle at the lateral malleolus.
LANDMARKS: Final = tuple(
    f"{side} {joint}" for side in ("right", "left") for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
)
#: Order of the points: the landmarks, helmet, binding of the right and of the left ski.
POINTS: Final = (*LANDMARKS, "P1", "P3", "P4")

#: Sigma of each coordinate of a point that stands for the centre of a head or a foot, m.
_STAND_IN_M: Final = 0.05


class Table(StrEnum):
    """Whose table of segments."""

    DE_LEVA = "de Leva 1996"
    DEMPSTER = "Dempster 1955 (Winter 2009)"


@dataclass(frozen=True, slots=True)
class Masses:
    """What the jumper weighs.

    Attributes:
        total_kg: with boots and skis.
        ski_kg: one ski with its binding.
        boot_kg: one boot.

    Raises:
        BadInputError: a mass is negative, or nothing is left for the body.
    """

    total_kg: float
    ski_kg: float
    boot_kg: float

    def __post_init__(self) -> None:
        """Check the masses."""
        if min(self.ski_kg, self.boot_kg) < 0 or not self.body_kg > 0:
            raise BadInputError(
                f"masses of {self.total_kg:g} kg in total, {self.ski_kg:g} kg a ski, {self.boot_kg:g} kg a boot: give "
                "the total with boots and skis, and what one of each weighs"
            )

    @property
    def body_kg(self) -> float:
        """The body alone."""
        return self.total_kg - 2 * (self.ski_kg + self.boot_kg)


@dataclass(frozen=True, slots=True)
class CentreOfMass:
    """Centres of mass of n pulses.

    Attributes:
        position: m, (n, 3).
        measurement: covariance that follows from that of the points, m^2, (n, 3, 3).
        table: covariance that follows from the table, m^2, (n, 3, 3).
    """

    position: Floats
    measurement: Floats
    table: Floats


@dataclass(frozen=True, slots=True)
class _Segment:
    """A segment, or the one of each side.

    Attributes:
        share: of the body's mass; of one side.
        share_sigma: from person to person.
        start: point where it begins; "mid shoulder" is between both shoulders.
        end: point where it ends; "binding" is that of the same side.
        where: the centre, as share of the way from start to end.
        where_sigma: from person to person; 0 where `stands_in` says more.
        paired: whether there is a right and a left one.
        stands_in: whether the points only stand for those of the table.
    """

    share: float
    share_sigma: float
    start: str
    end: str
    where: float
    where_sigma: float
    paired: bool = True
    stands_in: bool = False


#: Beyond the wrist, in forearms: de Leva's hand has its centre at 79 % of 86.2 mm, his forearm is 268.9 mm long.
_HAND_BEYOND: Final = 0.79 * 86.2 / 268.9

_SEGMENTS: Final = {
    Table.DE_LEVA: (
        _Segment(0.0694, 0.0059, "P1", "P1", 0.0, 0.0, paired=False, stands_in=True),
        _Segment(0.4346, 0.0206, "mid shoulder", "mid hip", 0.4310, 0.0155, paired=False),
        _Segment(0.0271, 0.0022, "shoulder", "elbow", 0.5772, 0.0272),
        _Segment(0.0162, 0.0015, "elbow", "wrist", 0.4574, 0.0211),
        _Segment(0.0061, 0.0008, "elbow", "wrist", 1 + _HAND_BEYOND, 0.0417),
        _Segment(0.1416, 0.0082, "hip", "knee", 0.4095, 0.0169),
        _Segment(0.0433, 0.0036, "knee", "ankle", 0.4459, 0.0130),
        _Segment(0.0137, 0.0010, "ankle", "binding", 0.5, 0.0, stands_in=True),
    ),
    Table.DEMPSTER: (
        _Segment(0.081, 0.0059, "P1", "P1", 0.0, 0.0, paired=False, stands_in=True),
        _Segment(0.497, 0.0206, "mid shoulder", "mid hip", 0.5, 0.0155, paired=False),
        _Segment(0.028, 0.0022, "shoulder", "elbow", 0.436, 0.0272),
        # Forearm and hand together, so that no point of the hand is needed.
        _Segment(0.022, 0.0017, "elbow", "wrist", 0.682, 0.0211),
        _Segment(0.100, 0.0082, "hip", "knee", 0.433, 0.0169),
        _Segment(0.0465, 0.0036, "knee", "ankle", 0.433, 0.0130),
        _Segment(0.0145, 0.0010, "ankle", "binding", 0.5, 0.0, stands_in=True),
    ),
}


def stacked(points: Mapping[str, Floats]) -> Floats:
    """The points in the order of `POINTS`, m, (n, 15, 3), from arrays (n, 3) by name.

    Raises:
        BadInputError: points are missing.
    """
    if missing := [name for name in POINTS if name not in points]:
        raise BadInputError(
            f"no centre of mass: {', '.join(missing)} missing; P1..P4 cannot carry it, it takes the twelve landmarks "
            "(right and left shoulder, elbow, wrist, hip, knee, ankle) with P1, P3 and P4"
        )
    return np.stack([np.asarray(points[name], float) for name in POINTS], axis=-2)


def centre_of_mass(points: Floats, covariance: Floats, table: Table, masses: Masses | None = None) -> CentreOfMass:
    """Centre of mass with both of its uncertainties.

    Args:
        points: in the order of `POINTS`, m, (n, 15, 3); a pulse with a NaN has no result (NaN).
        covariance: of the coordinates of all points together, m^2, (n, 45, 45), point by point.
        table: the table of segments.
        masses: for body, boots and skis together; None: the body alone.

    Raises:
        BadInputError: the arrays do not have these shapes.
    """
    n, count = len(points), len(POINTS)
    if points.shape != (n, count, 3) or covariance.shape != (n, 3 * count, 3 * count):
        raise BadInputError(
            f"points of shape {points.shape} with a covariance of shape {covariance.shape}: give (n, {count}, 3) and "
            f"(n, {3 * count}, {3 * count}), in the order of POINTS; P1..P4 alone cannot carry a centre of mass"
        )
    weights, changes, stand_ins = _weights(table, masses)
    other = Table.DEMPSTER if table is Table.DE_LEVA else Table.DE_LEVA
    apart = (weights - _weights(other, masses)[0]) / 2
    by_table = np.einsum("kp,npa->nka", np.vstack((changes, apart)), points)
    blocks = covariance.reshape(n, count, 3, count, 3)
    return CentreOfMass(
        position=np.einsum("p,npa->na", weights, points),
        measurement=np.einsum("p,npaqb,q->nab", weights, blocks, weights),
        table=np.einsum("nka,nkb->nab", by_table, by_table) + stand_ins * np.eye(3),
    )


def independent(covariances: Floats) -> Floats:
    """Covariance of all points together, (n, 45, 45), of points (n, 15, 3, 3) that are measured independently."""
    n, count = covariances.shape[:2]
    joint = np.zeros((n, count, 3, count, 3))
    place = np.arange(count)
    joint[:, place, :, place] = np.swapaxes(covariances, 0, 1)
    return joint.reshape(n, 3 * count, 3 * count)


def _weights(table: Table, masses: Masses | None) -> tuple[Floats, Floats, float]:
    """How the centre of mass depends on the points: it is a weighted mean of them.

    Returns:
        Weights of the points, (15,); how one sigma of each value of the table changes them, (k, 15); variance of each
        coordinate that comes from points which stand for others, m^2.
    """
    segments = _SEGMENTS[table]
    centres = [_centres(segment) for segment in segments]
    total = sum(segment.share * len(own) for segment, own in zip(segments, centres, strict=True))
    body = sum(segment.share * np.sum(own, axis=0) for segment, own in zip(segments, centres, strict=True)) / total
    changes, variance = [], 0.0
    part = 1.0 if masses is None else masses.body_kg / masses.total_kg
    boot = 0.0 if masses is None else masses.boot_kg / masses.total_kg
    for segment, own in zip(segments, centres, strict=True):
        changes.append(segment.share_sigma * np.sum(own - body, axis=0))
        changes.append(segment.where_sigma * segment.share * np.sum(_ways(segment), axis=0))
        if segment.stands_in:
            share = part * segment.share / total + (boot if segment.paired else 0.0)
            variance += len(own) * (share * _STAND_IN_M) ** 2
    weights = part * body
    if masses is not None:
        feet = _centres(next(segment for segment in segments if segment.end == "binding"))
        weights = weights + boot * np.sum(feet, axis=0)
        weights = weights + masses.ski_kg / masses.total_kg * (_point("P3") + _point("P4"))
    return weights, part / total * np.array(changes), variance


def _centres(segment: _Segment) -> Floats:
    """Centre of a segment, of each side if it is paired, as weights of the points, (1 or 2, 15)."""
    starts = np.array([_end(segment.start, side) for side in _sides(segment)])
    return np.asarray(starts + segment.where * _ways(segment))


def _ways(segment: _Segment) -> Floats:
    """From start to end, likewise."""
    return np.array([_end(segment.end, side) - _end(segment.start, side) for side in _sides(segment)])


def _sides(segment: _Segment) -> tuple[str, ...]:
    return ("right", "left") if segment.paired else ("",)


def _end(name: str, side: str) -> Floats:
    """An end of a segment as weights of the points, (15,)."""
    if name.startswith("mid "):
        joint = name.removeprefix("mid ")
        return np.asarray((_point(f"right {joint}") + _point(f"left {joint}")) / 2)
    if name == "binding":
        return _point("P3" if side == "right" else "P4")
    return _point(f"{side} {name}" if side else name)


def _point(name: str) -> Floats:
    return np.asarray(np.eye(len(POINTS))[POINTS.index(name)])
