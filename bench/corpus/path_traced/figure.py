"""The jumper of the path-traced pictures: rigid smooth parts, and where they are in a pose.

Markers are thin plates: helmet and hip lie on the surface of the body, towards the cameras, so that the body stands
behind them; those of the skis stand upright on the ski line before the toes of the boots, where the ski is no more than
a rod. The centre of each plate is the marker's place in the truth. In some scenes that of the hip has a dark patch
around it, in the others the suit.
"""

import math
from typing import Final

import numpy as np

from bench.corpus.path_traced.meshes import Mesh, disc, ellipsoid, limb, skin
from rig.arrays import Floats
from simrig.world.jumper import Pose
from simrig.world.scenario import Jumper

MARKER_THICK_M: Final = 0.006
_PATCH: Final = 1.6  # radii of a marker
_CLEAR_M: Final = 0.01  # between a marker's plate and the body behind it
_HELMET_M, _PELVIS_M = 0.13, 0.155
_HEAD_M: Final = 0.19  # from the middle of the helmet to the neck
_HIP_ASIDE_M, _SHOULDER_ASIDE_M, _HAND_ASIDE_M = 0.055, 0.16, 0.21
_TOE_M, _ANKLE_BACK_M, _ANKLE_UP_M = 0.02, 0.2, 0.11
_THIGH_M: Final = 0.45
#: Of the parts that are stretched from joint to joint, m.
_LENGTHS: Final = {
    "trunk": 0.5,
    "neck": 0.19,
    "thigh": 0.47,
    "shank": 0.47,
    "upper arm": 0.25,
    "forearm": 0.25,
    "boot": 0.2,
    "shaft": 0.2,
}
_SKI_WIDTHS: Final = ((-1.15, 0.045), (-0.7, 0.05), (0.0, 0.046), (0.8, 0.05), (1.15, 0.056), (1.3, 0.052))
_SKI_THICK_M, _ROD_M, _TIP_M, _TIP_UP_M = 0.018, 0.004, 0.28, 0.09
_PRINTS: Final = ((-0.8, -0.65), (-0.4, -0.3), (0.3, 0.45), (0.75, 0.9))  # shares of half the ski


class Figure:
    """The jumper of a scenario.

    Args:
        jumper: its settings.
        towards: unit direction from the jumper to the cameras that shall see its markers, shape (3,).
        bend_m: by how much the middle of a ski lies below its ends.
        patched: whether the hip has a patch around its marker.
    """

    def __init__(self, jumper: Jumper, towards: Floats, bend_m: float, patched: bool) -> None:
        self._jumper, self._towards, self._patched = jumper, towards, patched
        self.meshes: dict[str, tuple[Mesh, tuple[str, ...]]] = {
            "trunk": (limb(_LENGTHS["trunk"], (0.12, 0.122, 0.13, 0.15, 0.165, 0.15, 0.09), 0.72), ("suit",)),
            "pelvis": (ellipsoid(_PELVIS_M, _PELVIS_M, _PELVIS_M), ("suit",)),
            "neck": (limb(_LENGTHS["neck"], (0.06, 0.055)), ("skin",)),
            "helmet": (ellipsoid(_HELMET_M, _HELMET_M, _HELMET_M), ("helmet",)),
            "visor": (ellipsoid(0.1, 0.08, 0.07), ("visor",)),
            "thigh": (limb(_LENGTHS["thigh"], (0.06, 0.078, 0.08, 0.074, 0.066)), ("suit",)),
            "shank": (limb(_LENGTHS["shank"], (0.064, 0.066, 0.06, 0.052, 0.05)), ("suit",)),
            "upper arm": (limb(_LENGTHS["upper arm"], (0.06, 0.058, 0.048)), ("suit",)),
            "forearm": (limb(_LENGTHS["forearm"], (0.046, 0.046, 0.036)), ("suit",)),
            "glove": (ellipsoid(0.05, 0.035, 0.09), ("glove",)),
            "boot": (limb(_LENGTHS["boot"], (0.055, 0.05, 0.048, 0.04), 0.85), ("boot",)),
            "shaft": (limb(_LENGTHS["shaft"], (0.055, 0.058, 0.06)), ("boot",)),
            "ski": (_ski(jumper.ski_length_m, bend_m, jumper.marker_radius_m), ("ski", "print")),
            "marker": (disc(jumper.marker_radius_m, MARKER_THICK_M), ("marker",)),
            "patch": (disc(_PATCH * jumper.marker_radius_m, MARKER_THICK_M / 3), ("patch",)),
        }

    def joints(self, pose: Pose) -> Floats:
        """All points of the figure in the order of `simrig.world.figure.body.joints`, m, shape (19, 3)."""
        forward, side, up = pose.axes
        pelvis = pose.markers[1] - (_PELVIS_M + _CLEAR_M) * self._faces(pose)[1]
        helmet = pose.markers[0] - (_HELMET_M + _CLEAR_M) * self._towards
        trunk = (helmet - pelvis) / np.linalg.norm(helmet - pelvis)
        neck = helmet - _HEAD_M * trunk
        back = up - (up @ trunk) * trunk
        back /= np.linalg.norm(back)
        points = [*pose.markers, neck]
        for i, outward in ((0, -side), (1, side)):
            along, half = pose.skis[i], self._jumper.ski_length_m / 2
            above = _above(along)
            ankle = pose.markers[2 + i] - (self._toe_m + _ANKLE_BACK_M) * along + _ANKLE_UP_M * above
            hip = pelvis + _HIP_ASIDE_M * outward
            shoulder = neck - 0.05 * trunk + _SHOULDER_ASIDE_M * outward
            hand = pelvis + _HAND_ASIDE_M * outward - 0.06 * trunk + 0.13 * back
            points += [pose.markers[2 + i] + half * along, pose.markers[2 + i] - half * along]
            points += [ankle, _knee(ankle, hip, forward), hip, shoulder, hand]
        return np.stack(points)

    def placed(self, pose: Pose, worn: tuple[bool, ...]) -> dict[str, tuple[str, Floats]]:
        """Where the parts are.

        Args:
            pose: the pose.
            worn: which markers the jumper wears.

        Returns:
            By name of the part its mesh and its place, a matrix of shape (4, 4).
        """
        points, side = self.joints(pose), pose.axes[1]
        neck, pelvis = points[4], (points[9] + points[16]) / 2
        helmet = pose.markers[0] - (_HELMET_M + _CLEAR_M) * self._towards
        trunk = (neck - pelvis) / np.linalg.norm(neck - pelvis)
        face = np.cross(side, trunk)
        ends = {
            "trunk": (pelvis, neck, side),
            "pelvis": (pelvis, pelvis + trunk, side),
            "neck": (neck, helmet, side),
            "helmet": (helmet, helmet + trunk, side),
            "visor": (helmet + 0.065 * face + 0.02 * trunk, helmet + 0.065 * face + trunk, side),
        }
        for i, which in enumerate(("right", "left")):
            _, _, ankle, knee, hip, shoulder, hand = points[5 + 7 * i : 12 + 7 * i]
            along, binding = pose.skis[i], pose.markers[2 + i]
            above, elbow = _above(along), shoulder + 0.5 * (hand - shoulder) + 0.03 * pose.axes[2]
            toe = binding - (self._toe_m + 0.05) * along + 0.05 * above
            heel = toe - _LENGTHS["boot"] * along
            ends |= {
                f"{which} thigh": (hip, knee, side),
                f"{which} shank": (knee, ankle, side),
                f"{which} upper arm": (shoulder, elbow, side),
                f"{which} forearm": (elbow, hand, side),
                f"{which} glove": (hand, hand + (hand - elbow), side),
                f"{which} boot": (heel, toe, side),
                f"{which} shaft": (heel + 0.03 * along, ankle + 0.3 * (knee - ankle), side),
                f"{which} ski": (binding, binding + along, np.cross(along, above)),
            }
        upright = np.array((0.0, 0.0, 1.0))
        plates = zip(pose.markers, self._faces(pose), worn, strict=True)
        ends |= {f"P{i} marker": (X, X + face, upright) for i, (X, face, on) in enumerate(plates, 1) if on}
        if self._patched and worn[1]:
            face = self._faces(pose)[1]
            behind = pose.markers[1] - MARKER_THICK_M * face
            ends["P2 patch"] = (behind, behind + face, upright)
        meshes = {name: next(mesh for mesh in self.meshes if name.endswith(mesh)) for name in ends}
        return {name: (meshes[name], _between(*of, _LENGTHS.get(meshes[name]))) for name, of in ends.items()}

    def _faces(self, pose: Pose) -> list[Floats]:
        """Where the plates of P1..P4 face, unit: that of the hip is upright on the trunk, which else would hide it."""
        trunk = pose.markers[0] - pose.markers[1]
        trunk /= np.linalg.norm(trunk)
        hip = self._towards - (self._towards @ trunk) * trunk
        return [self._towards, np.asarray(hip / np.linalg.norm(hip)), self._towards, self._towards]

    @property
    def _toe_m(self) -> float:
        """From the middle of a ski's marker back to the toe of the boot, m."""
        return self._jumper.marker_radius_m + _TOE_M


def _ski(length_m: float, bend_m: float, rod_m: float) -> Mesh:
    """A ski along z, its top towards -y: tapered, bent, with a turned up tip, prints, and a rod in its middle."""
    half = length_m / 2
    prints = [(a * half, b * half) for a, b in _PRINTS]
    rod = [-rod_m, -rod_m + 0.002, rod_m - 0.002, rod_m]
    steps = np.unique(np.round([*np.linspace(-half, half, 41), *np.ravel(prints), *rod], 4))
    rings, known = [], np.array(_SKI_WIDTHS)
    for s in steps:
        wide = float(np.interp(s * 2.6 / length_m, known[:, 0], known[:, 1]))
        tip = max(0.0, s - (half - _TIP_M)) / _TIP_M
        wide *= math.sqrt(max(0.05, 1 - tip**3))
        lift = bend_m * ((s / half) ** 2 - 1 / 3) + _TIP_UP_M * tip**2
        thick = _SKI_THICK_M
        if abs(s) < rod_m - 0.001:
            wide, thick = _ROD_M, _ROD_M
        low, high = -lift + thick / 2, -lift - thick / 2
        rings.append([(-wide, high, s), (wide, high, s), (wide, low, s), (-wide, low, s)])
    marked = [i for i, s in enumerate(steps[:-1]) if any(a - 1e-6 <= s < b - 1e-6 for a, b in prints)]
    return skin(np.array(rings), smooth=False, marked=marked)


def _above(along: Floats) -> Floats:
    """The direction that is up from a ski, unit, shape (3,)."""
    up = np.array((0.0, 0.0, 1.0)) - along[2] * along
    return np.asarray(up / np.linalg.norm(up))


def _between(a: Floats, b: Floats, side: Floats, length_m: float | None) -> Floats:
    """The matrix (4, 4) that puts a part along z at `a` towards `b`, with its x axis towards `side`.

    Args:
        a: shape (3,), m.
        b: likewise.
        side: a direction, shape (3,).
        length_m: of the part, which is stretched to reach from `a` to `b`; None: it keeps its size.
    """
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length
    x = side - (side @ z) * z
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.stack((x, np.cross(z, x), z * (length / length_m if length_m else 1.0), a), axis=1)
    return matrix


def _knee(ankle: Floats, hip: Floats, forward: Floats) -> Floats:
    """Knee between ankle and hip, bent forward as far as the leg's length asks."""
    leg = hip - ankle
    length = float(np.linalg.norm(leg))
    part = max(_THIGH_M, 0.505 * length)
    aside = forward - (forward @ leg) / length**2 * leg
    bend = math.sqrt(part**2 - (length / 2) ** 2)
    return np.asarray(ankle + leg / 2 + bend * aside / np.linalg.norm(aside))
