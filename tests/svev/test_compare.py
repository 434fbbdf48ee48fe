"""`svev compare`: files, lines and exit codes."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.result.file import write
from svev.cli import main
from tests.analysis.result.recordings import recording, without_takeoff


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("measured")
    for name, given in {
        "monday": recording(seed=1, jumps=2),
        "tuesday": recording(seed=2, leg_deg=2.0),
        "wednesday": recording(5, seed=3),
        "dark": without_takeoff(recording(seed=4)),
    }.items():
        (folder / name).mkdir()
        write(replace(given, recording=name), folder / name / "jumper.json")
    shutil.copytree(folder / "wednesday", folder / "wednesday-again")
    return folder


def test_two_jumps_are_compared(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(measured)
    out = tmp_path / "compared"
    assert main(["compare", "monday", "tuesday", "--also", "wednesday", "--out", str(out)]) == 0
    lines = capsys.readouterr().out
    assert "different at 5 %" in lines
    assert re.search(r"leg angle: \+\d\.\d ± \d\.\d ° at \+\d\.\d\d s \(p < 0\.0001\); two of the athlete's", lines)
    assert "leg angle: 2 ° in more than 99 %" in lines
    result = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    assert result["format"] == "svev-comparison/1"
    assert result["different"] == ["alpha"]
    assert result["same_calibration"] is True
    assert result["scatter"] == {"jumps": 2, "degrees_of_freedom": 1}
    assert result["b"] == {
        "name": "tuesday",
        "recording": "tuesday",
        "jump": 1,
        "session": {"athlete": "A. Jumper", "bib": "7"},
    }
    alpha = result["quantities"]["alpha"]
    assert len(alpha["difference"]) == len(result["since_takeoff_s"]) == len(alpha["p_scatter"])
    # the jumper's legs were turned by 2 degrees
    assert alpha["greatest"]["difference"] == pytest.approx(2.0, abs=4 * alpha["greatest"]["sigma"])


def test_a_recording_that_is_given_several_times_counts_once(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(measured)
    again = ["wednesday", "wednesday/jumper.json", str(measured / "wednesday"), "wednesday-again", "tuesday"]
    also = [word for path in again for word in ("--also", path)]
    assert main(["compare", "monday", "tuesday", *also, "--out", str(tmp_path / "out")]) == 0
    assert "wednesday-again: is recording wednesday, as wednesday is; it counts once" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "comparison.json").read_text())["scatter"]["jumps"] == 2


def test_the_page_needs_nothing_else(measured: Path, tmp_path: Path) -> None:
    assert main(["compare", str(measured / "monday"), str(measured / "tuesday"), "--out", str(tmp_path)]) == 0
    page = (tmp_path / "comparison.html").read_text(encoding="utf-8")
    assert set(re.findall(r"https?://[^\"' ]*", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<script|<link|<img|@import|url\(", page)
    assert page.count("<svg") == 2 * 22 + 5  # charts in two languages, stick figures at five places
    assert "nan" not in page.lower().replace("nanos", "")
    assert "so there are no pictures" in page


def test_the_page_speaks_to_a_coach(measured: Path, tmp_path: Path) -> None:
    folders = [str(measured / name) for name in ("monday", "tuesday")]
    assert main(["compare", *folders, "--language", "nb", "--out", str(tmp_path)]) == 0
    page = (tmp_path / "comparison.html").read_text(encoding="utf-8")
    assert '<html lang="nb">' in page
    assert 'id="in-nb" checked' in page
    assert re.search(r"<title>A\. Jumper \(7\) . A\. Jumper \(7\)</title>", page)
    assert not re.search(rf"{measured}|monday|tuesday|--also|svev ", page)
    assert re.search(
        r'<span lang="en">Leg angle: \d\.\d° ± \d\.\d+° more in B, \d\.\d\d s after the take-off</span>', page
    )
    assert re.search(r'<span lang="nb">Leggvinkel: \d,\d° ± \d,\d+° mer i B, \d,\d\d s etter satsen</span>', page)
    english, norwegian = (
        len(re.findall(f'lang="{language}"', page.partition("<body>")[2])) for language in ("en", "nb")
    )
    assert english == norwegian > 100


def test_json_is_the_last_thing_said(measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    monday = str(measured / "monday")
    assert main(["compare", monday, monday, "--jump-b", "2", "--out", str(tmp_path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["b"]["jump"] == 2
    assert "difference" not in result["quantities"]["alpha"]
    assert result["quantities"]["alpha"]["greatest"]["p"] <= 1
    assert result["scatter"] is None


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("monday", "monday"), "this is one jump; choose another to compare it with by --jump-b"),
        (("monday", "sunday"), "no such file; name a folder that svev analyze wrote"),
        (("monday", "dark"), "jump 1 has no take-off"),
        (("monday", "tuesday", "--jump-b", "2"), r"has no jump 2 \(it has 1\)"),
    ],
)
def test_what_cannot_be_compared_is_said_in_one_line(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], says: str
) -> None:
    first, second, *more = arguments
    out = tmp_path / "out"
    assert main(["compare", str(measured / first), str(measured / second), *more, "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert re.search(says, said.err)
    assert not out.exists()
