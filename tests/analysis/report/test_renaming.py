"""A name that is corrected after the measuring: what says whose jump it is is written anew from the result."""

import re
from pathlib import Path

import pytest

from analysis.measurements.file import write_measurements
from analysis.procedure.renaming import read_cameras, write_cameras, write_renamed
from analysis.report.coach import write_report
from analysis.report.kinogram.folder import write_kinograms
from analysis.result import file as result_file
from analysis.result.model import Quantity
from analysis.result.naming import CAMERAS, bears_names
from rig.errors import BadInputError
from tests.analysis.report.jumps import measured_recording, measurements
from tests.analysis.simulated import true_cameras

ACROSS = {1: Quantity(2.3, 0.08)}


@pytest.fixture
def folder(tmp_path: Path, jump_log: Path) -> Path:
    """What the measuring wrote of a jump of Anna's: the files that another name concerns, and what they come from."""
    made, result = tmp_path / "made", measured_recording()
    made.mkdir()
    result_file.write(result, made / "jumper.json")
    write_measurements(measurements(), made / "measurements.json")
    write_cameras(true_cameras(), made / CAMERAS)
    write_kinograms(result, measurements(), true_cameras(), jump_log, made, perpendicular=ACROSS)
    write_report(result, measurements(), true_cameras(), jump_log, made / "report.html", perpendicular=ACROSS)
    return made


def test_the_same_files_come_out_with_another_name(folder: Path, jump_log: Path, tmp_path: Path) -> None:
    again, before = tmp_path / "again", measured_recording().session
    write_renamed(folder, jump_log, again, {}, earlier=[])
    named = {path.name for path in folder.iterdir() if bears_names(path.name)}
    assert {path.name for path in again.iterdir()} == named
    for name in named - {"report.html"}:
        assert (again / name).read_bytes() == (folder / name).read_bytes(), name
    words, numbers = _parts(again / "report.html")
    assert words == _parts(folder / "report.html")[0]
    assert numbers == pytest.approx(_parts(folder / "report.html")[1], abs=0.11)  # drawn places, to a tenth

    write_renamed(folder, jump_log, again, {"athlete": "Kari <Ås>", "bib": "99"}, earlier=[])
    old, new = before["athlete"], "Kari &lt;Ås&gt;"
    for name in ("report.html", "kinogram.html"):
        page = (again / name).read_text(encoding="utf-8")
        assert new in page
        assert old not in page
    assert result_file.read(again).session == {**before, "athlete": "Kari <Ås>", "bib": "99"}
    assert (again / "kinogram.jpg").read_bytes() != (folder / "kinogram.jpg").read_bytes()


def _parts(page: Path) -> tuple[list[str], list[float]]:
    """The text of a page, and the numbers in it."""
    parts = re.split(r"(?<![\w/+])(-?\d+\.\d+)(?![\w/+])", page.read_text(encoding="utf-8"))
    return parts[::2], [float(number) for number in parts[1::2]]


def test_cameras_are_read_as_they_were_written(tmp_path: Path) -> None:
    write_cameras(true_cameras(), tmp_path / CAMERAS)
    found = read_cameras(tmp_path / CAMERAS)
    assert found.names == true_cameras().names
    for name, camera in true_cameras().cameras.items():
        assert (found[name].camera.interior == camera.camera.interior).all()
        assert (found[name].position == camera.position).all()
        assert found[name].rotation == pytest.approx(camera.rotation, abs=1e-14)
        assert (found[name].size == camera.size).all()


def test_a_result_without_cameras_says_what_is_missing(folder: Path, jump_log: Path, tmp_path: Path) -> None:
    (folder / CAMERAS).unlink()
    with pytest.raises(BadInputError, match=CAMERAS):
        write_renamed(folder, jump_log, tmp_path / "again", {}, earlier=[])
