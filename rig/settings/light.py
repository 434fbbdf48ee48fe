"""Exposure and gain of a camera, changed while the rig runs, and written into the text of the rig file."""

from collections.abc import Mapping

import tomlkit

from rig.errors import BadInputError, UnknownCameraError
from rig.settings.camera import CameraSettings
from rig.settings.editing import as_toml, camera_table, editable
from rig.settings.model import RigSettings
from rig.settings.strict_toml import validate


def camera_of(rig: RigSettings, name: str) -> CameraSettings:
    """The camera of this name.

    Raises:
        UnknownCameraError: the rig has no such camera.
    """
    for camera in rig.cameras:
        if camera.name == name:
            return camera
    raise UnknownCameraError(f"no camera {name}: the rig has {', '.join(each.name for each in rig.cameras)}")


def with_light(rig: RigSettings, name: str, light: Mapping[str, float]) -> RigSettings:
    """The rig with another exposure or gain of a camera.

    Args:
        rig: the rig.
        name: of the camera.
        light: `exposure_us`, `gain_db` or both.

    Raises:
        UnknownCameraError: the rig has no such camera.
        BadInputError: a value is out of range, or the camera would expose for longer than from pulse to pulse.
    """
    camera = camera_of(rig, name)
    changed = validate(CameraSettings, camera.model_dump(exclude_unset=True) | dict(light), f"camera {name}")
    period_us = rig.trigger.period_ns / 1000
    if changed.exposure_us >= period_us:
        raise BadInputError(
            f"camera {name} would expose for {changed.exposure_us / 1000:g} ms, and pulses come every "
            f"{period_us / 1000:.1f} ms: choose a shorter exposure"
        )
    cameras = tuple(changed if each is camera else each for each in rig.cameras)
    return rig.model_copy(update={"cameras": cameras})


def written(text: str, name: str, light: Mapping[str, float]) -> str:
    """The text of a rig file with another exposure or gain of a camera; everything else in it stays as it is.

    Args:
        text: of the rig file (TOML).
        name: of the camera.
        light: `exposure_us`, `gain_db` or both.

    Raises:
        BadInputError: the text is not TOML, or has no such camera.
    """
    document = editable(text)
    camera = camera_table(document, name)
    for key, value in light.items():
        camera[key] = as_toml(value)
    return tomlkit.dumps(document)
