"""Marks as a table: every state survives, spreadsheets' dialects are read right or refused."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.digitizing.exchange.csv_file import csv_of, read_csv
from analysis.digitizing.marks.journal import Entered, Key
from rig.api.digitizing import MarkSource, MarkState
from rig.errors import BadInputError

NAMES = st.text(
    st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp")), min_size=1, max_size=20
).filter(lambda name: name == name.strip() and name.isprintable())
PLACES = st.floats(-1e5, 1e5, allow_nan=False)
SIGMAS = st.none() | st.tuples(*(st.floats(1e-6, 1000, allow_nan=False),) * 2)


@st.composite
def marks(draw: st.DrawFn) -> tuple[Key, Entered]:
    """A mark, as the journal holds it."""
    thing = draw(st.sampled_from(("P1", "ball:B7", "mark:left_knee", "left ski")) | NAMES.map("mark:{}".format))
    state = draw(st.sampled_from(MarkState))
    placed = state in {MarkState.MEASURED, MarkState.GUESS}
    vertex = draw(st.integers(0, 999)) if placed and thing == "left ski" else -1
    key = Key(draw(st.integers(0, 2**53)), draw(st.sampled_from(("K1", "K2")) | NAMES), thing, vertex)
    xy = draw(st.tuples(PLACES, PLACES)) if placed else None
    return key, Entered(state, xy, draw(SIGMAS), draw(st.sampled_from(MarkSource)))


@given(st.lists(marks(), max_size=8, unique_by=lambda item: item[0]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_every_mark_comes_back(tmp_path: Path, written: list[tuple[Key, Entered]]) -> None:
    path = tmp_path / "marks.csv"
    path.write_bytes(csv_of(written))
    assert read_csv(path) == written


ROWS = "pulse;camera;thing;vertex;state;x (px);y (px);sigma x (px);sigma y (px);source\n"
OTHER_ORDER = """Thing,Y [px],X,Pulse,Camera,Sigma_x,sigma y,source,state
P1,2.25,1.5,7,K1,0.5,0.5,refined,
P1,,,8,K1,,,,hidden
"""
EXPECTED = [
    (Key(7, "K1", "P1"), Entered(MarkState.MEASURED, (1.5, 2.25), (0.5, 0.5), MarkSource.REFINED)),
    (Key(8, "K1", "P1"), Entered(MarkState.HIDDEN)),
]


@pytest.mark.parametrize(
    "text",
    [
        ROWS + "7;K1;P1;;measured;1,5;2,25;0,5;0,5;refined\n8;K1;P1;;hidden;;;;;hand\n",
        "\ufeff" + ROWS + "7;K1;P1;;measured;1.5;2.25;0.5;0.5;refined\n8;K1;P1;;hidden;;;;;hand\n",
        ROWS.replace(";", "\t")
        + "7\tK1\tP1\t\tMeasured\t1,5\t2,25\t0,5\t0,5\trefined\n8\tK1\tP1\t\thidden\t\t\t\t\t\n",
        "sep=,\n"
        + ROWS.replace(";", ",")
        + '7,K1,"P1",,measured,1.5,2.25,.5,5e-1,refined\r\n8,K1,P1,,hidden,,,,,hand\r\n',
        OTHER_ORDER,
    ],
)
def test_spreadsheets_are_read_right(text: str, tmp_path: Path) -> None:
    path = tmp_path / "marks.csv"
    path.write_bytes(text.encode())
    assert read_csv(path) == EXPECTED


@pytest.mark.parametrize(
    "text",
    [
        "pulse,camera,thing,x,y\n5,K1,P1,10,5,20,25\n",
        "pulse,camera,thing,x,y\n5,K1,P1,10,5,20,\n",
        "pulse;camera;thing;x;y\n5;K1;P1;a;10;20\n",
        "pulse camera thing x y sigma_x sigma_y\n5 K1 P1 10.5 20.5  0.3\n",
    ],
)
def test_rows_with_other_numbers_of_cells_than_headings_are_refused(text: str, tmp_path: Path) -> None:
    """A decimal comma between commas would move all that follows: 10,5 and 20,25 were the place 10, 5."""
    (tmp_path / "marks.csv").write_text(text)
    with pytest.raises(BadInputError, match=r"line 2: \d cells below \d headings; write decimals with a point"):
        read_csv(tmp_path / "marks.csv")


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("7;K1;P1;;measured;1,5;2.25;;;", "is a decimal comma or none"),
        ("7;K1;P1;;measured;1,5;;;;", "line 2: give both, x and y"),
        ("7;K1;P1;;measured;;;;;", "line 2: P1 is measured and has no place"),
        ("7;K1;P1;;hidden;1;2;;;", "line 2: P1 is hidden and has a place"),
        ("7;K1;P1;0;measured;1;2;;;", "line 2: P1 has no vertices"),
        ("7;K1;left ski;;measured;1;2;;;", "line 2: left ski needs a vertex"),
        ("7;K1;P1;;seen;1;2;;;", "line 2: state: "),
        ("7;K1;P1;;measured;1;2;-1;1;", "line 2: sigma.0: "),
        ("7;K1;P1;;measured;nan;2;;;", "line 2: x and y are nan and 2; write numbers"),
        ("7;K1;P1;;measured;1_0;2;;;", "line 2: x and y are 1_0 and 2; write numbers"),
        ("1_7;K1;P1;;measured;1;2;;;", 'line 2: "1_7" is no whole number'),
        ("7;K1;P1;;measured;one;2;;;", "line 2: x and y are one and 2; write numbers"),
        ("7.5;K1;P1;;measured;1;2;;;", 'line 2: "7.5" is no whole number'),
        ("7;;P1;;measured;1;2;;;", "line 2: camera: "),
        ("7;K1;P1;;measured;1;2;;;\n7;K1;P1;;guess;1;2;;;", "line 3: P1 at pulse 7 in K1 stands twice"),
    ],
)
def test_what_says_no_mark_is_refused_with_its_line(row: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "marks.csv"
    path.write_text(ROWS + row + "\n")
    with pytest.raises(BadInputError, match=said):
        read_csv(path)


def test_a_table_of_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "marks.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(BadInputError, match="no column is headed pulse, camera, thing, x, y"):
        read_csv(path)
    path.write_text("")
    with pytest.raises(BadInputError, match="holds no rows"):
        read_csv(path)
