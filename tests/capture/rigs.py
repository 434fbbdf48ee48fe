"""Rigs for tests: the simulated hill behind each back end, with the faults that a test asks for."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from tests.support.loopback import Loopback

_FIREWIRE_IN_MIXED = 2
SCENARIO = CONFIG / "scenarios" / "training.toml"


def write_rig(
    directory: Path,
    backend: str,
    loopback: Loopback,
    *,
    faults: list[dict[str, Any]] | None = None,
    scenario: str = "",
    rate_hz: float = 30.0,
    names: Sequence[str] = ("K1", "K2", "K3"),
    log: Path | None = None,
    source: str = "external",
    **network: Any,
) -> Path:
    """Write a rig file and its scenario.

    Args:
        directory: where.
        backend: "sim", "aravis", "iidc", "replay", or "mixed": two FireWire cameras, then GigE Vision ones.
        loopback: addresses of the simulated cameras and of the publication.
        faults: faults of the scenario, as in its TOML.
        scenario: more TOML for the top of the scenario.
        rate_hz: of the pulses.
        names: cameras of the scenario.
        log: what back end "replay" replays.
        source: who makes the pulses.
        network: more keys of the [network] table.
    """
    tables = "".join("\n[[faults]]\n" + "\n".join(f"{k} = {json.dumps(v)}" for k, v in f.items()) for f in faults or [])
    (directory / "scenario.toml").write_text(f'base = "{SCENARIO}"\nname = "test"\n{scenario}\n{tables}\n')
    lines = ['name = "test rig"', "[trigger]", f'source = "{source}"', f"rate_hz = {rate_hz}"]
    lines += ["[simulation]", 'scenario = "scenario.toml"'] if backend != "replay" else []
    lines += [
        "[network]",
        f'publish = "{loopback.endpoint()}"',
        *(f"{k} = {json.dumps(v)}" for k, v in network.items()),
    ]
    addresses = {
        "sim": [""] * len(names),
        "aravis": loopback.cameras(len(names)),
        "iidc": guids(len(names)),
        "replay": [str(log)] * len(names),
    }
    for index, name in enumerate(names):
        kind = backend if backend != "mixed" else "iidc" if index < _FIREWIRE_IN_MIXED else "aravis"
        lines += ["[[cameras]]", f'name = "{name}"', f'backend = "{kind}"']
        lines += [f'address = "{addresses[kind][index]}"'] if kind != "sim" else []
    path = directory / "rig.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def guids(count: int) -> list[str]:
    """GUIDs of emulated FireWire cameras. Every test has a bus of its own, so all tests may use the same GUIDs."""
    return [f"000a4701011b{number:04x}" for number in range(1, count + 1)]


def make_rig(directory: Path, backend: str, loopback: Loopback, **options: Any) -> RigSettings:
    """The rig of `write_rig`, read."""
    return load_rig(write_rig(directory, backend, loopback, **options))
