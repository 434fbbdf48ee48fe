"""An archive of Svev says under which terms it stands, and holds the licences of all that it holds."""

import runpy
import sys
import zipfile
from pathlib import Path

import pytest

from tests.systemd.prefixes import SYSTEMD


def _wheel(bundle: Path, name: str, about: str, *further: str) -> None:
    with zipfile.ZipFile(bundle / "wheels" / f"{name}-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr(
            f"{name}-1.0.dist-info/METADATA", f"Metadata-Version: 2.4\nName: {name}\nVersion: 1.0\n{about}\n"
        )
        for path in further:
            wheel.writestr(path, f"text of {path}")


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    (tmp_path / "wheels").mkdir()
    _wheel(tmp_path, "plain", "License-Expression: MIT", "plain-1.0.dist-info/licenses/LICENSE", "plain/__init__.py")
    _wheel(tmp_path, "old", "Classifier: License :: OSI Approved :: BSD License", "old-1.0.dist-info/LICENSE.txt")
    return tmp_path


def _said(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(sys, "argv", ["licences.py", str(bundle)])
    runpy.run_path(str(SYSTEMD / "licences.py"), run_name="__main__")
    return (bundle / "LICENCES.txt").read_text()


def test_every_wheel_has_its_line_and_its_texts(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _wheel(bundle, "bare", "License: Apache 2.0")
    said = _said(bundle, monkeypatch)
    assert "plain 1.0: MIT\n" in said
    assert "old 1.0: BSD License\n" in said
    assert "bare 1.0: Apache 2.0 (the wheel holds no text)\n" in said
    assert (bundle / "licences" / "plain-1.0" / "licenses-LICENSE").read_text().startswith("text of plain")
    assert (bundle / "licences" / "old-1.0" / "LICENSE.txt").exists()
    assert "No library under the GPL" in said
    assert not (bundle / "licences" / "GPL-3").exists()


def test_a_library_under_the_gpl_decides_for_the_whole(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _wheel(
        bundle, "av", "License-Expression: BSD-3-Clause", "av.libs/libx264-d6533a8d.so.165", "av.libs/libopus-1.so.0"
    )
    said = _said(bundle, monkeypatch)
    assert "under the GNU General Public License, version 3 or later" in said
    assert "libx264 in av 1.0" in said
    assert "libraries of others inside: libopus, libx264" in said
    assert "GNU GENERAL PUBLIC LICENSE" in (bundle / "licences" / "GPL-3").read_text()
