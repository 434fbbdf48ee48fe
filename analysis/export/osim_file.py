"""Writes `jumper.osim`, a model for OpenSim whose markers are the points of `jumper.trc`, by the same names.

Helmet, hip, middle of the bindings and both skis are bodies. A ski moves freely but for the rotation about its own
axis, which no point shows; the others have a place alone. Axes are those of the file (Y up); a ski lies along X of its
body. Masses are 1 kg, for they are not known: inverse kinematics does not use them, and dynamics with them would mean
nothing.
"""

from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from analysis.export.places import SKI_LENGTH_M, SMOOTHED

_VERSION: Final = "40000"
_ROTATIONS, _TRANSLATIONS = ("rx", "ry", "rz"), ("tx", "ty", "tz")
#: Bodies that are a point, and its label.
_POINTS: Final = {"helmet": "P1", "hip": "P2", "origin": "O"}
#: Skis, the label of the binding, and the beginning of those of their ends.
_SKIS: Final = {"right_ski": ("P3", "right"), "left_ski": ("P4", "left")}


def write(path: Path, ski_length_m: float = SKI_LENGTH_M) -> None:
    """Write the model.

    Raises:
        OSError: the disk refuses.
    """
    document = ET.Element("OpenSimDocument", Version=_VERSION)
    model = ET.SubElement(document, "Model", name="jumper")
    ET.SubElement(model, "length_units").text = "m"
    bodies, joints, markers = (_set(model, kind) for kind in ("BodySet", "JointSet", "MarkerSet"))
    for body, label in _POINTS.items():
        _body(bodies, joints, body, locked=_ROTATIONS)
        _markers(markers, body, {label: 0.0})
    for body, (binding, side) in _SKIS.items():
        _body(bodies, joints, body, locked=("rx",))
        half = ski_length_m / 2
        _markers(markers, body, {binding: 0.0, f"{side}_tail": -half, f"{side}_tip": half})
    ET.indent(document)
    ET.ElementTree(document).write(path, encoding="utf-8", xml_declaration=True)


def _set(model: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(ET.SubElement(model, kind, name=kind.lower()), "objects")


def _body(bodies: ET.Element, joints: ET.Element, name: str, *, locked: tuple[str, ...]) -> None:
    """A body and what it can do: move in space, but for the rotations that are locked."""
    body = ET.SubElement(bodies, "Body", name=name)
    for key, value in {"mass": "1", "mass_center": "0 0 0", "inertia": "1 1 1 0 0 0"}.items():
        ET.SubElement(body, key).text = value
    joint = ET.SubElement(joints, "FreeJoint", name=f"{name}_joint")
    ET.SubElement(joint, "socket_parent_frame").text = "/ground"
    ET.SubElement(joint, "socket_child_frame").text = f"/bodyset/{name}"
    coordinates = ET.SubElement(joint, "coordinates")
    for each in (*_ROTATIONS, *_TRANSLATIONS):
        coordinate = ET.SubElement(coordinates, "Coordinate", name=f"{name}_{each}")
        ET.SubElement(coordinate, "locked").text = str(each in locked).lower()


def _markers(markers: ET.Element, body: str, along: dict[str, float]) -> None:
    """Raw and smoothed markers of a body, by where they are along its X, m."""
    for ending in ("", SMOOTHED):
        for label, x in along.items():
            marker = ET.SubElement(markers, "Marker", name=label + ending)
            ET.SubElement(marker, "socket_parent_frame").text = f"/bodyset/{body}"
            ET.SubElement(marker, "location").text = f"{x:.4f} 0 0"
