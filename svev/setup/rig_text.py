"""The text of a rig file with the answers in it; what is not asked about stays as it is, comments too."""

from typing import Final

import tomlkit
from tomlkit.items import AoT, Table

from rig.errors import BadInputError
from rig.settings.editing import as_toml, editable
from rig.settings.trigger import (
    ActionTrigger,
    ExternalTrigger,
    GpioTrigger,
    IidcBroadcastTrigger,
    SoftwareTrigger,
    TriggerBoxTrigger,
    TriggerSettings,
)
from svev.setup.answers import Answers, CameraAnswer, Source

_EXPOSURE_US: Final = 1000
_HEAD: Final = "# Written by svev setup. Run it again at any time: what it does not ask about stays.\n"
_SOURCES: Final[dict[Source, type[TriggerSettings]]] = {
    "external": ExternalTrigger,
    "triggerbox": TriggerBoxTrigger,
    "gpio": GpioTrigger,
    "action": ActionTrigger,
    "software": SoftwareTrigger,
    "iidc-broadcast": IidcBroadcastTrigger,
}


def rig_text(before: str | None, answers: Answers) -> str:
    """The text of the rig file.

    Args:
        before: its text until now; None: there is none.
        answers: everything that was asked.

    Raises:
        BadInputError: the text until now is not TOML.
    """
    document = editable(_HEAD if before is None else before)
    document["name"] = answers.name
    document.pop("simulation", None)  # the cameras are real
    _put_trigger(_table(document, "trigger"), answers)
    _table(document, "recorder")["directory"] = str(answers.recordings)
    if answers.survey is not None:
        analysis = _table(document, "analysis")
        analysis["survey"] = answers.survey_name
        analysis.pop("calibration", None)
    elif "survey" in document.get("analysis", {}):
        document.pop("analysis")
    if answers.packet_size is not None:
        _table(document, "network")["packet_size"] = answers.packet_size
    _put_cameras(document, answers)
    return f"{tomlkit.dumps(document).rstrip()}\n"


def _table(document: tomlkit.TOMLDocument, name: str) -> dict[str, object]:
    """A table of the document, made before the cameras if missing."""
    found = document.get(name)
    if found is None:
        cameras = document.pop("cameras", None)
        found = document[name] = tomlkit.table()
        if cameras is not None:
            document["cameras"] = cameras
        found = document[name]
    if not isinstance(found, dict):
        raise BadInputError(f'the rig file\'s "{name}" is no table: correct it there')
    return found


def _put_trigger(table: dict[str, object], answers: Answers) -> None:
    known = set(_SOURCES[answers.source].model_fields)
    for key in [key for key in table if key not in known]:
        del table[key]  # of another source
    values: dict[str, object] = {"source": answers.source, "rate_hz": as_toml(answers.rate_hz)}
    if answers.port is not None:
        values["port"] = answers.port
    if answers.line is not None:
        values["line"] = int(answers.line) if answers.line.isdecimal() else answers.line
    for key, value in values.items():
        if table.get(key) != value:
            table[key] = value


def _put_cameras(document: tomlkit.TOMLDocument, answers: Answers) -> None:
    cameras = document.get("cameras")
    there: list[Table] = list(cameras) if isinstance(cameras, AoT) else []
    tables = [_camera(there, camera) for camera in answers.cameras]
    for table, camera in zip(tables, answers.cameras, strict=True):
        table["name"], table["backend"], table["address"] = camera.name, camera.backend, camera.address
        if camera.backend == "aravis" and answers.input is not None:
            table["trigger_input"] = answers.input
    if len(tables) == len(there) and all(new is old for new, old in zip(tables, there, strict=True)):
        return  # the form of the file stays
    document.pop("cameras", None)
    made = tomlkit.aot()
    for table in tables:
        made.append(table)
    document["cameras"] = made


def _camera(there: list[Table], camera: CameraAnswer) -> Table:
    """The table of a camera, a new one if it has none."""
    for table in there:
        if (table.get("backend"), str(table.get("address", "")).lower().removeprefix("0x")) == (
            camera.backend,
            camera.address,
        ):
            return table
    made = tomlkit.table()
    made["name"], made["backend"], made["address"] = camera.name, camera.backend, camera.address
    if camera.region is not None:
        region = tomlkit.inline_table()
        region.update({"x": 0, "y": 0, "width": camera.region[0], "height": camera.region[1]})
        made["region"] = region
    made["exposure_us"] = _EXPOSURE_US
    return made
