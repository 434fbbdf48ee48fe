"""Rig files of the tests, each with loopback addresses of its own."""

from pathlib import Path

from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from tests.support.loopback import Loopback

SIM = load_rig(CONFIG / "rigs" / "sim.toml")


def write_rig(folder: Path, loopback: Loopback, *, backend: str = "aravis", simulated: bool = True) -> Path:
    """Write a rig file with three cameras of this test's own addresses."""
    # A busy machine may take long until simulated cameras have drawn their first image.
    text = f'name = "examined"\n[trigger]\nsettle_s = 60\n[network]\npublish = "{loopback.endpoint()}"\n'
    if simulated:
        text += f'[simulation]\nscenario = "{CONFIG / "scenarios" / "training.toml"}"\n'
    for index, address in enumerate(loopback.cameras(3), start=1):
        text += f'[[cameras]]\nname = "K{index}"\nbackend = "{backend}"\naddress = "{address}"\n'
    path = folder / "rig.toml"
    path.write_text(text)
    return path


def rig_with(folder: Path, loopback: Loopback, **network: object) -> RigSettings:
    """Such a rig with other network settings."""
    rig = load_rig(write_rig(folder, loopback))
    return rig.model_copy(update={"network": rig.network.model_copy(update=network)})
