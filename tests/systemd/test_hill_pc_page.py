"""The files that the page on the hill PC tells people to write: understood by the programs that read them."""

import configparser
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rig.settings.file import CONFIG, load_rig
from tests.systemd.prefixes import units_into

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "hill-pc.md").read_text()
_NETWORKD = Path("/lib/systemd/systemd-networkd")


def _blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


def _with(word: str) -> str:
    """The block that holds a word."""
    (block,) = (block for block in _blocks("ini") if word in block)
    return block


def test_what_is_added_to_the_rig_file_is_a_rig(tmp_path: Path) -> None:
    rig = (CONFIG / "rigs" / "hill-gige.toml").read_text().replace('directory = "recordings"\n', "")
    parts = _blocks("toml")
    assert len(parts) == 3
    for part in parts:
        # Tables that the file has already are continued there, as a person would do it.
        table, keys = part.split("\n", 1)
        whole = rig.replace(table + "\n", part) if table in rig else rig + part
        path = tmp_path / "rig.toml"
        path.write_text(whole)
        settings = load_rig(path)
        added = settings.service.arm_at_start, settings.recorder.fallback_directory, settings.analysis
        assert any(added), keys


def test_the_unit_understands_what_is_added_to_it(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    prefix = tmp_path / "prefix"
    units_into(prefix, "#!/bin/sh\n")
    unit = prefix / "lib/systemd/system/svev.service"
    drop_in = unit.with_name("svev.service.d") / "override.conf"
    drop_in.parent.mkdir()
    drop_in.write_text(_with("ReadWritePaths"))
    command = ["systemd-analyze", "verify", str(unit)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_the_network_settings_are_those_of_this_systemd() -> None:
    if not _NETWORKD.exists():
        pytest.skip("systemd-networkd is not installed")
    known = _NETWORKD.read_bytes()
    keys = []
    for word in ("LinkLocalAddressing", "DHCPServer"):
        file = configparser.ConfigParser()
        file.optionxform = str  # type: ignore[assignment,method-assign]
        file.read_string(_with(word))
        keys += [f"{section}.{key}" for section in file.sections() for key in file[section]]
    assert len(keys) == 13
    assert [key for key in keys if key.encode() + b"\0" not in known] == []
