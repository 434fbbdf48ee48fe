import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import typer.main
from typer.core import TyperGroup

from rig.settings.file import rig_schema
from svev import cli
from tests.support.commands import run_svev
from tests.support.loopback import Loopback


def _commands() -> list[str]:
    group = typer.main.get_command(cli.command_line())
    assert isinstance(group, TyperGroup)
    return sorted(group.commands)


def _run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return run_svev(*arguments)


@pytest.mark.parametrize("command", _commands())
def test_every_command_explains_itself_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([command, "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Example" in text
    assert f"svev {command}" in text.split("Example")[1]


def _walk(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Every command of the command line with the words that call it, groups too."""
    yield " ".join(path), command
    for name, below in getattr(command, "commands", {}).items():
        yield from _walk(below, (*path, name))


def test_every_option_of_every_command_is_spelt_and_explained_alike() -> None:
    wrong = []
    for path, command in _walk(typer.main.get_command(cli.command_line())):
        for parameter in command.params:
            name, opts = f"svev {path} {parameter.opts[-1]}", set(parameter.opts)
            if not parameter.help:
                wrong.append(f"{name}: no text")
            flag = parameter.param_type_name == "option" and parameter.is_flag
            if not flag and (not parameter.metavar or set(parameter.metavar) & set("<>[]{}")):
                wrong.append(f"{name}: value {parameter.metavar!r}")
            if opts & {"-o", "--out", "--output"} and opts != {"-o", "--out"}:
                wrong.append(f"{name}: an output is -o and --out")
    assert wrong == []


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("demo",),
        ("ctl",),
        ("ctl", "startlist", "load"),
        ("network", "import"),
        ("network", "export"),
        ("calibrate",),
        ("info",),
        ("bench",),
        ("plan",),
        ("target",),
    ],
)
def test_help_has_a_short_name_everywhere(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*words, "-h"]) == 0
    short = capsys.readouterr().out
    assert cli.main([*words, "--help"]) == 0
    assert capsys.readouterr().out == short
    assert not re.search("<[a-z]|[.]{3}}?[.]{3}|[{}]|<=|>=", short)
    assert "-h, --help" in short


def test_no_list_of_commands_ends_in_dots() -> None:
    for path, command in _walk(typer.main.get_command(cli.command_line())):
        for name, below in getattr(command, "commands", {}).items():
            assert not below.get_short_help_str(limit=56).endswith("..."), f"svev {path} {name}: give it a short_help"


def test_nothing_is_overwritten_unless_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rig.schema.json"
    assert cli.main(["schema", "-o", str(path)]) == 0
    path.write_text("mine")
    assert cli.main(["schema", "--output", str(path)]) == 2  # the former name of the option
    assert capsys.readouterr().err == f"svev: {path}: exists already; choose another name, or replace it by --force\n"
    assert path.read_text() == "mine"
    assert cli.main(["schema", f"--output={path}", "--force"]) == 0
    assert path.read_text(encoding="utf-8") == rig_schema()


def test_orient_and_analyze_agree_on_the_points_that_tie_the_images() -> None:
    commands = dict(_walk(typer.main.get_command(cli.command_line(["orient", "analyze"]))))
    defaults = {
        parameter.default for name in ("orient", "analyze") for parameter in commands[name].params
        if "--alternative" in parameter.opts
    }  # fmt: skip
    assert len(defaults) == 1


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    listed = capsys.readouterr().out
    assert all(f"\n  {command} " in listed for command in _commands())


def test_the_help_loads_no_command() -> None:
    check = (
        "import sys; from svev.cli import main; main(['--help']); assert not {'numpy', 'pydantic'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", check], capture_output=True, timeout=60, check=True)


def test_the_version_says_where_it_is_installed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"svev {version('svev')}, in {sys.prefix}\n"


def test_recording_loads_nothing_that_measures() -> None:
    """Its processes start at once, and a library that only the analysis needs cannot prevent a recording."""
    loaded = "import sys, svev.commands.rig.record, svev.commands.rig.serve; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, timeout=60, check=True)
    assert not {"analysis.procedure.analyze", "photogrammetry", "scipy"} & set(done.stdout.split())


def test_schema_is_the_rig_files_schema(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert cli.main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(rig_schema())
    assert cli.main(["schema", "-o", str(tmp_path / "schema.json")]) == 0
    assert (tmp_path / "schema.json").read_text() == rig_schema()


@pytest.mark.parametrize("arguments", [["nonsense"], ["schema", "--nonsense"], ["schema", "-o"], ["schema", "extra"]])
def test_wrong_usage_ends_with_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(arguments) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_a_path_that_fails_is_one_line(tmp_path: Path) -> None:
    done = _run("schema", "-o", str(tmp_path / "none" / "schema.json"))
    assert done.returncode == 2
    assert done.stdout == ""
    path = tmp_path / "none" / "schema.json"
    assert done.stderr == f"svev: {path}: No such file or directory; check the path and its permissions\n"


def test_debug_shows_where_it_went_wrong(tmp_path: Path) -> None:
    done = _run("schema", "--debug", "-o", str(tmp_path / "none" / "schema.json"))
    assert done.returncode == 2
    assert "Traceback" in done.stderr
    assert "FileNotFoundError" in done.stderr


def test_a_reader_that_goes_away_is_no_crash() -> None:
    # The pipe's reading end is closed before anything is written.
    with subprocess.Popen(
        [sys.executable, "-m", "svev", "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        errors = process.stderr.read()
        assert process.wait(timeout=60) == 1
    assert errors == ""


@pytest.mark.parametrize(
    "command",
    [
        ("export", "no.mcap", "--out", "jump.mp4"),
        ("replay", "no.mcap"),
        ("import", "left.avi", "right.avi", "--out", "old.mcap", "--rate", "50"),
    ],
)
def test_pulses_that_end_before_they_begin_are_refused(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*command, "--from", "50", "--to", "20"]) == 2
    assert capsys.readouterr().err == "svev: --from 50 --to 20: ends before it begins; exchange the two\n"


def test_a_table_of_balls_is_no_survey_and_leads_to_the_command_that_makes_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "balls.csv"
    table.write_text("name,E,N,H,sigma\nB1,1.5,2.5,3.5,0.01\n")
    assert cli.main(["analyze", "no.mcap", "--survey", str(table), "--out", str(tmp_path / "out")]) == 2
    assert f"svev network import calibration.json {table} -o survey.json" in capsys.readouterr().err


def test_cameras_that_do_not_answer_are_told_once_with_the_rig_file_for_the_doctor(
    tmp_path: Path, loopback: Loopback
) -> None:
    rig = tmp_path / "my rig.toml"
    cameras = "".join(
        f'[[cameras]]\nname = "K{n}"\nbackend = "aravis"\naddress = "{loopback.host.rpartition(".")[0]}.{n + 200}"\n'
        for n in (1, 2)
    )
    publish = f'[network]\npublish = "{loopback.endpoint()}"\n'
    rig.write_text(f'name = "not there"\n{publish}[trigger]\nsettle_s = 0.1\n{cameras}')
    done = _run("record", "--rig", str(rig), "--seconds", "1", "--out", str(tmp_path / "logs"))
    assert done.returncode == 2
    assert "gone" not in done.stderr
    assert done.stderr.count("K1") == done.stderr.count("check power, cable and address") == 1
    assert done.stderr.endswith(f"then run: svev doctor --rig '{rig}'\n")
