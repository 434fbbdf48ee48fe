"""Reads a rig file; every error message names file, key and remedy."""

import json
from pathlib import Path

from rig.settings.file_kinds import FileKind, refuse_other
from rig.settings.model import RigSettings
from rig.settings.strict_toml import read_toml, validate

#: Folder of the rig files and scenarios that are part of the program, in a checkout and when installed.
CONFIG = Path(__file__).resolve().parents[2] / "config"


def load_rig(path: Path) -> RigSettings:
    """Read and check a rig file, and make the paths in it absolute.

    Raises:
        BadInputError: the file is missing, is not TOML, or does not describe a rig.
    """
    content = read_toml(path)
    refuse_other(content, FileKind.RIG, path)
    rig = validate(RigSettings, content, path)
    absolute: dict[str, object] = {}
    if rig.simulation is not None:
        scenario = (path.parent / rig.simulation.scenario).resolve()
        absolute["simulation"] = rig.simulation.model_copy(update={"scenario": scenario})
    given = {"calibration": rig.calibration, "plan": rig.plan}
    absolute |= {name: (path.parent / file).resolve() for name, file in given.items() if file is not None}
    if rig.analysis is not None:
        named = {name: getattr(rig.analysis, name) for name in ("survey", "calibration")}
        files = {name: (path.parent / file).resolve() for name, file in named.items() if file is not None}
        absolute["analysis"] = rig.analysis.model_copy(update=files)
    if rig.network.curve_key_file is not None:
        keys = (path.parent / rig.network.curve_key_file).resolve()
        absolute["network"] = rig.network.model_copy(update={"curve_key_file": keys})
    if rig.service.webhook is not None:
        named = {name: getattr(rig.service.webhook, name) for name in ("url_file", "token_file")}
        files = {name: (path.parent / file).resolve() for name, file in named.items() if file is not None}
        webhook = rig.service.webhook.model_copy(update=files)
        absolute["service"] = rig.service.model_copy(update={"webhook": webhook})
    return rig.model_copy(update=absolute)


def rig_schema() -> str:
    """JSON schema of the rig file."""
    return json.dumps(RigSettings.model_json_schema(), indent=2) + "\n"
