"""The features of a GigE Vision camera, as its own description names them: value, unit, range."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from capture.aravis.features import text_at
from capture.aravis.library import Aravis, GLib
from rig.errors import CameraError, CameraNotFoundError

#: What Aravis gives as the upper bound of a number without one.
_NO_LIMIT: Final = frozenset({sys.float_info.max, float("inf"), 2**63 - 1, 2**32 - 1})
_NO_GATEWAY: Final = "0.0.0.0"  # noqa: S104 - an address that a camera is given, no one listens there


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature.

    Attributes:
        category: in which the camera lists it.
        value: its present value, as text.
        unit: unit of value and range; empty: none is told.
        allowed: range or choices, as text; empty: none is told.
    """

    category: str
    name: str
    value: str
    unit: str
    allowed: str


def features(address: str) -> list[Feature]:
    """All features of the camera at an address that can be read now.

    Raises:
        CameraNotFoundError: no camera answers there.
        CameraError: it does not describe itself.
    """
    try:
        device = Aravis.Camera.new(address).get_device()
    except GLib.Error as error:
        raise CameraNotFoundError(f"{address}: {error.message}; svev cameras list shows who is there") from None
    description = device.get_genicam()
    root = description.get_node("Root")
    if root is None:
        raise CameraError(f"{address}: the camera's description has no features; update its firmware")
    return list(_below(device, description, root))


def _below(device: Any, description: Any, category: Any) -> Iterator[Feature]:
    for name in category.get_features():
        node = description.get_node(name)
        if isinstance(node, Aravis.GcCategory):
            yield from _below(device, description, node)
        elif isinstance(node, Aravis.GcFeatureNode) and not isinstance(node, Aravis.GcCommand):
            try:
                yield Feature(category.get_name(), name, *_told(device, node, name))
            except GLib.Error:  # not readable in the camera's present state, or implemented on other models only
                continue


def _told(device: Any, node: Any, name: str) -> tuple[str, str, str]:
    """Value, unit, and what is allowed."""
    value = _text(device, node)
    if isinstance(node, Aravis.GcEnumeration):
        return value, "", ", ".join(device.dup_available_enumeration_feature_values_as_strings(name))
    if isinstance(node, Aravis.GcFloat):
        return value, node.get_unit() or "", _range(*device.get_float_feature_bounds(name))
    if isinstance(node, Aravis.GcInteger) and not isinstance(node, Aravis.GcBoolean):
        return value, node.get_unit() or "", _range(*device.get_integer_feature_bounds(name))
    return value, "", ""


def _text(device: Any, node: Any) -> str:
    """A value as text. Names that people give may hold any bytes, of which Aravis hands out UTF-8 alone."""
    try:
        return str(node.get_value_as_string())
    except UnicodeDecodeError:
        if isinstance(node, Aravis.GcRegister):
            return text_at(device, node.get_address(), node.get_length())
        return "(bytes that are no text in UTF-8)"


def _range(low: float, high: float) -> str:
    """A range as text; empty if the description tells none, for which Aravis gives the limits of the type."""
    return "" if high in _NO_LIMIT else f"{low} to {high}"


def keep_address(address: str, mask: str) -> None:
    """Have the camera at an address keep it when its power goes.

    Raises:
        CameraError: it refuses, or no camera answers there.
    """
    try:
        camera = Aravis.Camera.new(address)
        camera.gv_set_persistent_ip_from_string(address, mask, _NO_GATEWAY)
        camera.gv_set_ip_configuration_mode(Aravis.GvIpConfigurationMode.PERSISTENT_IP)
    except GLib.Error as error:
        raise CameraError(
            f"{address}: the camera has this address until its power goes, but does not keep it ({error.message}); end "
            "the program that controls it and set it again, or use its maker's program"
        ) from None
