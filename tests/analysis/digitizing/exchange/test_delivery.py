"""Marks go out to other programs and come back as they were."""

import zipfile
from io import BytesIO

import pytest

from analysis.digitizing.desk import Desk
from analysis.digitizing.exchange.delivery import delivered, taken_in
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import MarkState, StateAction, UndoAction
from rig.errors import BadInputError
from tests.analysis.digitizing.hill import clicks


@pytest.mark.parametrize("name", ["measurements.json", "marks.csv", "dltdv.zip"])
def test_marks_come_back_as_they_went_and_one_undo_takes_them_away(desk: Desk, jump: HillLog, name: str) -> None:
    for click in clicks(desk, jump, 9, range(12, 16)):
        desk.session("Anna").act(click.action())
    file = delivered(desk, "Anna", name)
    taken_in(desk, "Bo", name, file)
    anna, bo = (desk.session(operator).everything() for operator in ("Anna", "Bo"))
    assert [key for key, _ in bo] == [key for key, _ in anna]
    for (_, given), (_, found) in zip(anna, bo, strict=True):
        assert found.xy == pytest.approx(given.xy, abs=1e-4)
        assert found.state is MarkState.MEASURED
    if name != "dltdv.zip":  # which knows no sigmas
        assert [found.sigma for _, found in bo] == [pytest.approx(given.sigma) for _, given in anna]
    assert desk.act("Bo", UndoAction(do="undo")).touched is not None
    assert desk.session("Bo").everything() == []


def test_a_table_keeps_every_state(desk: Desk) -> None:
    for thing, state in (("P1", "hidden"), ("right ski", "not visible")):
        desk.act("Anna", StateAction(do="state", pulse=12, camera="K1", thing=thing, state=state))
    taken_in(desk, "Bo", "marks.csv", delivered(desk, "Anna", "marks.csv"))
    assert desk.session("Bo").everything() == desk.session("Anna").everything()


def test_argus_gets_its_folder_and_gives_the_points_back(desk: Desk, jump: HillLog) -> None:
    for click in clicks(desk, jump, 9, range(12, 14)):
        desk.session("Anna").act(click.action())
    with zipfile.ZipFile(BytesIO(delivered(desk, "Anna", "argus.zip"))) as archive:
        names = archive.namelist()
        points = archive.read(next(name for name in names if name.endswith("-xypts.csv")))
    assert any(name.endswith("-config.yaml") for name in names)
    keys = [key for key, _ in desk.session("Anna").everything()]
    for operator, content in (("Bo", points), ("Cato", delivered(desk, "Anna", "argus.zip"))):
        taken_in(desk, operator, "marks.csv", content)
        assert [key for key, _ in desk.session(operator).everything()] == keys


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("dltdv.zip", b"PK nonsense", "cannot be unpacked"),
        ("measurements.json", b"{}", "format"),
        ("marks.csv", b"pulse,camera,thing,x,y\n9999,K1,P1,1,2\n", "has pulse 9999"),
        ("marks.csv", b"pulse,camera,thing,x,y\n12,K9,P1,1,2\n", "has camera K9"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_and_nothing_changes(
    desk: Desk, name: str, content: bytes, said: str
) -> None:
    with pytest.raises(BadInputError, match=said):
        taken_in(desk, "Bo", name, content)
    assert desk.session("Bo").revision == 0
