"""Files of users that have the names of ours, such as service.py, change nothing about the programs that we start."""

import ast
import subprocess
from pathlib import Path

import pytest

from rig.api.export import ExportOrder
from rig.background.child import run_child
from rig.background.messages import Failed
from rig.transport.launcher import program_command, program_environment
from service.exports.program import Export, Exported

_CODE = Path(__file__).parents[3]
_ROOMS = (
    "svev",
    "webpanel",
    "service",
    "analysis",
    "recorder",
    "photogrammetry",
    "capture",
    "triggering",
    "simrig",
    "rig",
)
_OWN_NAMES = (*_ROOMS, "bench", "config")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A user's folder with a file of each of our names."""
    for name in _OWN_NAMES:
        (tmp_path / f"{name}.py").write_text(f'raise SystemExit("{name}.py of the user")\n')
    return tmp_path


def _files() -> list[Path]:
    return [path for room in _ROOMS for path in sorted((_CODE / room).rglob("*.py"))]


def _programs() -> list[str]:
    """All our modules that are started as programs."""
    return [
        ".".join(path.relative_to(_CODE).with_suffix("").parts)
        for path in _files()
        if 'if __name__ == "__main__":' in path.read_text(encoding="utf-8")
    ]


def test_all_programs_are_ours_in_a_folder_with_files_of_our_names(folder: Path) -> None:
    names = [name for name in _programs() if not name.endswith("__main__")]
    assert len(names) > 10
    code = f"import importlib, sys\nfor name in {names}: importlib.import_module(name)"
    python, safe, *_ = program_command(names[0])
    done = subprocess.run(
        [python, safe, "-c", code], cwd=folder, env=program_environment(), capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_no_module_starts_an_interpreter_by_itself() -> None:
    """`program_command` does: it leaves the present folder out."""
    elsewhere = [
        str(path.relative_to(_CODE))
        for path in _files()
        if path.name != "launcher.py"
        and "executable" in (text := path.read_text(encoding="utf-8"))
        and any(
            isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.executable"
            for node in ast.walk(ast.parse(text))
        )
    ]
    assert elsewhere == []


def test_an_export_is_made_in_such_a_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    order = Export(log=folder / "none.mcap", order=ExportOrder(kind="csv"), out=folder / "out.csv")
    end = run_child("service.exports.program", order, Exported, busy=lambda: False, wanted=lambda: True)
    assert isinstance(end, Failed)
    assert "none.mcap" in end.said.text, "our program has looked for the log"
