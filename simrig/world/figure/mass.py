"""Twelve landmarks of the simulated figure, and the centre of its mass.

The figure's segments have the masses and centres of de Leva (1996, J. Biomech. 29:1223, men); trunk from the neck to
the middle of the hips, head at the helmet marker, hand at the middle of the glove, foot halfway from ankle to ski. The
mass of the scenario's jumper is that with skis and boots.
"""

import numpy as np

from rig.arrays import Floats
from simrig.world.scenario import Jumper

LANDMARKS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
_ELBOW, _WRIST = 0.48, 0.9  #: share of the way from shoulder to hand
_HEAD, _TRUNK = 0.0694, 0.4346
#: Share of the body's mass, and where on the segment from its upper end the centre is.
_UPPER_ARM, _FOREARM = (0.0271, 0.5772), (0.0162, 0.4574)
_THIGH, _SHANK = (0.1416, 0.4095), (0.0433, 0.4459)
_HAND, _FOOT = 0.0061, 0.0137
_TRUNK_CENTRE = 0.4486


def landmarks(joints: Floats) -> dict[str, Floats]:
    """Landmarks, m, shape (3,) each, by name ("right shoulder", ...), of the joints of `simrig.world.figure.body`."""
    found: dict[str, Floats] = {}
    for i, side in enumerate(("right", "left")):
        _, _, ankle, knee, hip, shoulder, hand = joints[5 + 7 * i : 12 + 7 * i]
        arm = hand - shoulder
        places = shoulder, shoulder + _ELBOW * arm, shoulder + _WRIST * arm, hip, knee, ankle
        found |= {f"{side} {name}": place for name, place in zip(LANDMARKS, places, strict=True)}
    return found


def centre_of_mass(joints: Floats, jumper: Jumper) -> tuple[Floats, Floats]:
    """Centre of mass of the body alone, and of body, skis and boots together; m, shape (3,) each."""
    named = landmarks(joints)
    helmet, neck = joints[0], joints[4]
    hips = (named["right hip"] + named["left hip"]) / 2
    body = _HEAD * helmet + _TRUNK * (neck + _TRUNK_CENTRE * (hips - neck))
    total = _HEAD + _TRUNK
    feet = []
    for i, side in enumerate(("right", "left")):
        shoulder, elbow, wrist, hip, knee, ankle = (named[f"{side} {name}"] for name in LANDMARKS)
        for (share, where), a, b in (
            (_UPPER_ARM, shoulder, elbow), (_FOREARM, elbow, wrist), (_THIGH, hip, knee), (_SHANK, knee, ankle),
        ):  # fmt: skip
            body = body + share * (a + where * (b - a))
            total += share
        feet.append((ankle + joints[2 + i]) / 2)
        body = body + _HAND * joints[11 + 7 * i] + _FOOT * feet[-1]
        total += _HAND + _FOOT
    body = np.asarray(body / total)
    equipment = 2 * (jumper.ski_mass_kg + jumper.boot_mass_kg)
    with_it = (jumper.mass_kg - equipment) * body
    for ski, foot in zip(joints[2:4], feet, strict=True):
        with_it = with_it + jumper.ski_mass_kg * ski + jumper.boot_mass_kg * foot
    return body, np.asarray(with_it / jumper.mass_kg)
