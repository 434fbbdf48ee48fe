"""What the service changes in a rig file: rate, calibration, parts; comments, order and all else stay as they are.

The text is a document in which single keys are changed. Exposure, gain and regions: `light`, `region`.
"""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from rig.errors import BadInputError
from rig.settings.model import RigSettings
from rig.settings.strict_toml import validate


def editable(text: str) -> tomlkit.TOMLDocument:
    """The document of a rig file's text.

    Raises:
        BadInputError: the text is not TOML.
    """
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise BadInputError(f"the rig file is not valid TOML any more: {error}; correct it there") from None


def camera_table(document: tomlkit.TOMLDocument, name: str) -> dict[str, Any]:
    """The table of a camera in the document of a rig file; what is changed in it is changed in the document.

    Raises:
        BadInputError: there is no such camera.
    """
    cameras = document.get("cameras", [])
    camera = next((each for each in cameras if each.get("name") == name), None) if isinstance(cameras, list) else None
    if not isinstance(camera, dict):
        raise BadInputError(f"the rig file has no camera {name} any more: start the service again")
    return camera


def as_toml(value: float) -> float:
    """A number as people write it: whole ones without a point."""
    return int(value) if float(value).is_integer() else value


def with_rate(rig: RigSettings, rate_hz: float) -> RigSettings:
    """The rig with another rate of its pulses.

    Args:
        rig: the rig.
        rate_hz: pulses per second.

    Raises:
        BadInputError: the source does not take the rate, or a camera would expose for longer than from pulse to pulse.
    """
    changed = rig.trigger.model_dump(exclude_unset=True) | {"rate_hz": rate_hz}
    trigger = validate(type(rig.trigger), changed, "trigger")
    longest = max(rig.cameras, key=lambda camera: camera.exposure_us)
    period_us = trigger.period_ns / 1000
    if longest.exposure_us >= period_us:
        raise BadInputError(
            f"at {rate_hz:g} Hz pulses would come every {period_us / 1000:.1f} ms, and camera {longest.name} exposes "
            f"for {longest.exposure_us / 1000:g} ms: choose a lower rate, or shorten its exposure first"
        )
    return rig.model_copy(update={"trigger": trigger})


def written_rate(text: str, rate_hz: float) -> str:
    """The text of a rig file with another rate of the pulses; everything else in it stays as it is.

    Raises:
        BadInputError: the text is not TOML, or has no trigger.
    """
    document = editable(text)
    trigger = document.get("trigger")
    if not isinstance(trigger, dict):
        raise BadInputError("the rig file has no [trigger] any more: start the service again")
    trigger["rate_hz"] = as_toml(rate_hz)
    return tomlkit.dumps(document)


def with_calibration(rig: RigSettings, path: Path, cameras: Collection[str]) -> RigSettings:
    """The rig with another calibration.

    Args:
        rig: the rig.
        path: of the result file.
        cameras: that were calibrated with the regions that they have now.
    """
    anew = tuple(
        camera.model_copy(update={"calibrated_region": None}) if camera.name in cameras else camera
        for camera in rig.cameras
    )
    return rig.model_copy(update={"calibration": path, "cameras": anew})


def written_calibration(text: str, path: Path, cameras: Collection[str]) -> str:
    """The text of a rig file with another calibration; everything else in it stays as it is.

    Args:
        text: of the rig file (TOML).
        path: of the result file; it stands there as it is.
        cameras: as above.

    Raises:
        BadInputError: the text is not TOML, or lacks a camera.
    """
    document = editable(text)
    document["calibration"] = str(path)
    for name in cameras:
        camera_table(document, name).pop("calibrated_region", None)
    return tomlkit.dumps(document)


def written_parts(text: str, part_s: float | None, part_gb: float | None) -> str:
    """The text of a rig file with other limits for the parts of a recording; everything else in it stays as it is.

    Args:
        text: of the rig file (TOML).
        part_s: longest part, s; None: any.
        part_gb: largest part, 10^9 bytes; None: any.

    Raises:
        BadInputError: the text is not TOML.
    """
    document = editable(text)
    recorder = document.get("recorder", {})
    for name, limit in (("part_s", part_s), ("part_gb", part_gb)):
        if limit is None:
            recorder.pop(name, None)
        else:
            recorder[name] = as_toml(limit)
    if recorder and "recorder" not in document:
        document["recorder"] = recorder
    return tomlkit.dumps(document)
