"""An archive of Svev says under which terms it stands, and holds the licences of all that it holds."""

import runpy
import sys
import tomllib
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
    said = _said(bundle, monkeypatch)
    assert "plain 1.0: MIT\n" in said
    assert "old 1.0: BSD License\n" in said
    assert (bundle / "licences" / "plain-1.0" / "licenses-LICENSE").read_text().startswith("text of plain")
    assert (bundle / "licences" / "old-1.0" / "LICENSE.txt").exists()
    assert "No library under the GPL" in said
    assert not (bundle / "licences" / "GPL-3").exists()


def test_a_wheel_without_text_gets_the_common_one(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _wheel(bundle, "bare", "Author: Foxes\nClassifier: License :: OSI Approved :: MIT License")
    _wheel(bundle, "tagged", "License: BSD", "tagged/a.py")
    with zipfile.ZipFile(bundle / "wheels" / "tagged-1.0-py3-none-any.whl", "a") as wheel:
        wheel.writestr("tagged/b.py", "# SPDX-License-Identifier:    BSD-3-Clause\n")
    said = _said(bundle, monkeypatch)
    assert "bare 1.0: MIT License (the wheel holds no text; the common one is added)\n" in said
    text = (bundle / "licences" / "bare-1.0" / "LICENCE").read_text()
    assert "Copyright (c) Foxes" in text
    assert "Permission is hereby granted, free of charge" in text
    assert "Neither the name of the copyright holder" in (bundle / "licences" / "tagged-1.0" / "LICENCE").read_text()


def test_a_licence_whose_text_is_nowhere_stops_the_bundle(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _wheel(bundle, "bare", "License: Something else")
    with pytest.raises(SystemExit, match=r"bare 1\.0 holds no text of its licence \(Something else\)"):
        _said(bundle, monkeypatch)


def test_a_library_under_the_gpl_decides_for_the_whole(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _wheel(
        bundle,
        "av",
        "License-Expression: BSD-3-Clause",
        "av-1.0.dist-info/licenses/LICENSE",
        "av.libs/libx264-d6533a8d.so.165",
        "av.libs/libopus-1.so.0",
    )
    said = _said(bundle, monkeypatch)
    assert "under the GNU General Public License, version 3 or later" in said
    assert "libx264 in av 1.0" in said
    assert "libraries of others inside: libopus, libx264" in said
    assert "GNU GENERAL PUBLIC LICENSE" in (bundle / "licences" / "GPL-3").read_text()
    added = (bundle / "licences" / "av-1.0" / "LIBRARIES").read_text()
    assert "libopus: BSD-3-Clause, copyright (c) 2001-2023 Xiph.Org" in added
    assert "libx264: GPL-2.0-or-later" in added
    assert "Neither the name" in (bundle / "licences" / "BSD-3-Clause").read_text()


def test_libraries_that_a_wheel_names_itself_need_nothing_more(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = ("fast.libs/libscipy_openblas64_-1.so", "fast.libs/libgfortran-2.so.5")
    _wheel(bundle, "fast", "License: BSD", "fast-1.0.dist-info/licenses/LICENSE-openblas-gfortran.txt", *inside)
    _said(bundle, monkeypatch)
    assert not (bundle / "licences" / "fast-1.0" / "LIBRARIES").exists()


@pytest.mark.parametrize("library", ["libunheard-1.so", "libssl-1.so.1"])
def test_a_library_of_which_no_licence_is_known_stops_the_bundle(
    bundle: Path, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    _wheel(bundle, "fast", "License: BSD", "fast-1.0.dist-info/licenses/LICENSE", f"fast.libs/{library}")
    with pytest.raises(SystemExit, match=r"fast 1\.0 holds lib\w+, which its texts do not name: add it to"):
        _said(bundle, monkeypatch)


def test_every_text_that_the_table_of_libraries_names_is_there() -> None:
    libraries = tomllib.loads((SYSTEMD / "licence-texts" / "libraries.toml").read_text())
    places = (SYSTEMD / "licence-texts", Path("/usr/share/common-licenses"))
    for known in libraries.values():
        for text in known.get("texts", ()):
            assert any((place / text).is_file() for place in places), text
