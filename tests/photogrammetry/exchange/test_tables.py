"""Tables of surveys: read as they stand or refused, in whatever dialect, encoding and order; never read otherwise."""

import csv
import io
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from photogrammetry.exchange.columns import read_aicon
from photogrammetry.exchange.importing import import_network
from rig.errors import BadInputError

BALLS: Final = {"B1": ([10.5, 20.25, 3.5], [0.01, 0.01, 0.02]), "B2": ([11.5, 21.25, 4.5], [0.01, 0.01, 0.02])}
_HEAD: Final = ("name", "X", "Y", "Z", "sX", "sY", "sZ")


def _points(path: Path) -> dict[str, tuple[list[float], list[float]]]:
    network = import_network([path]).network
    return {point.name: (np.asarray(point.xyz).tolist(), np.asarray(point.sigma).tolist()) for point in network.points}


def _file(folder: Path, text: str | bytes, name: str = "balls.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


SEMICOLONS: Final = "Name;X;Y;Z;sX;sY;sZ\r\nB1;10,5;20,25;3,5;0,01;0,01;0,02\r\nB2;11,5;21,25;4,5;0,01;0,01;0,02\r\n"


@pytest.mark.parametrize(
    "text",
    [
        SEMICOLONS,
        SEMICOLONS.replace("\r\n", "\r"),
        "sep=;\r\n" + SEMICOLONS,
        "# surveyed in May\r\nsep=;\r\n" + SEMICOLONS,
        SEMICOLONS.replace("B1", '"B1"').replace(";X;", ';"X";').replace("20,25", '"20,25"'),
        SEMICOLONS.replace("\r\n", ";;\r\n") + ";;;;;;;;\r\n",
        SEMICOLONS.replace(";", "\t"),
        SEMICOLONS.replace(";", " "),
        SEMICOLONS.replace(";", "   "),
        SEMICOLONS.replace(",", ".").replace(";", ", "),
        SEMICOLONS.replace(",", ".").replace(";", ",").split("\r\n", 1)[1],
        SEMICOLONS.replace(";", "\t").split("\r\n", 1)[1],
        SEMICOLONS.encode("utf-16"),
        SEMICOLONS.encode("utf-8-sig"),
        "# point x y z sx sy sz\n" + SEMICOLONS.split("\r\n", 1)[1],
        SEMICOLONS.replace("X;Y;Z;", "E;N;H;"),
        SEMICOLONS.replace("X;Y;Z;", "Easting;Northing;Height;"),
        SEMICOLONS.replace("Name;X;Y;Z;", "Punkt;Øst;Nord;Høyde;"),
        "B1;10,500;20,250;3,500;0,010;0,010;0,020\nB2;11,500;21,250;4,500;0,010;0,010;0,020\n",
        "ball;N;E;H;sx;sy;sz\nB1;20.25;10.5;3.5;0.01;0.01;0.02\nB2;21.25;11.5;4.5;0.01;0.01;0.02\n",
        "Z;Name;X;Y;sigma_z;sx;sy\n3.5;B1;10.5;20.25;0.02;0.01;0.01\n4.5;B2;11.5;21.25;0.02;0.01;0.01\n",
    ],
)
def test_a_table_is_read_as_it_stands(text: str | bytes, tmp_path: Path) -> None:
    assert _points(_file(tmp_path, text)) == BALLS


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("name;X;Y;Z;sX;sY;sZ\nB1;10,5;20,25;;0,01;0,01;0,02\n", "line 2, column z: the cell is empty"),
        ("B1;10,5;20,25;;0,01;0,01;0,02\n", "line 1, column z: the cell is empty"),
        ("B1 10,5 20,5 3,5\nB2 11,5 21,5 4,5\n", "blanks separate the cells, so an empty one is not seen"),
        ("B1 0 0  0.005 0.005\n", "blanks separate the cells, so an empty one is not seen"),
        ("B1,10,5,20,5,3,5\nB2,11,5,21,5,4,5\n", "no decimal point, so commas may"),
        ("name,X,Y,Z,s\nB1,10,5,20,5,3,5,0,01\n", "line 2: 9 columns, but only"),
        ('name,X,Y,Z,s\nB1,"10,5","20,5","3,5","0,01"\n', "'10,5' in a file that commas separate"),
        ("name;X;Y;Z;s\nB1;1,234;20.5;3.5;0.01\n", "'1,234' beside '20.5' is a decimal comma or none"),
        ("name X Y Z s\nBall 1 10.5 20.5 3.5 0.01\n", "line 2: 6 columns, but only name"),
        ("Left 1 10.5 20.5 3.5\nRight 2 11.5 21.5 4.5\n", "line 1: 'Left 1' may be one name"),
        ("L,1,10.5,20.5,3.5\nR,2,11.5,21.5,4.5\n", "line 1: 'L,1' may be one name"),
        ("name X Y Z s\nBall 1 10.5 20.5 0.01\n", "line 2: 'Ball 1' may be one name"),
        ("L1,1.5,10.5,20.5,0.02,0.01\n", "line 1: sigmas sx, sy: give one for all"),
        ("name X Y Z s\nB1 10.5 20.5 0.01\n", "line 2: 4 cells instead of 5"),
        ("name;X;Y;Z;sX;sZ\nB1;1;2;3;0.1;0.2\n", "line 2: sigmas sx, sz: give one for all"),
        ("name;X;Y;Z;s;sZ\nB1;1;2;3;0.1;0.2\n", "line 2: sigmas s, sz: give one for all"),
        ("name;X;Y;Z;sX;sY;sZ\nB1;1;2;3;0.1;;0.2\n", "line 2: a sigma is empty beside others"),
        ("B1;1.5;2;3;0.1;\n", "line 1: a sigma is empty beside others"),
        ("name;X;Y;Z;s\nB1;1;2;3;-0.1\n", "line 2: a sigma of -0.1 is none"),
        ("name;X;X;Y;Z;s\nB1;1;1;2;3;0.1\n", "columns 'X' and 'X' are the same, x"),
        ("Id;Name;X;Y;Z;s\n7;B1;1;2;3;0.1\n", "columns 'Id' and 'Name' are the same, name"),
        (
            "1;17;10.5;20.5;3.5\n2;18;11.5;21.5;4.5\n",
            "the column after the name holds whole numbers alone and may be no coordinate",
        ),
        ("name X Y Z s\n5 6 -22.5 33.5  1\nB2 1.5 2.5 3.5 1\n", "line 2: '5 6' may be one name"),
        (
            "1;17;10;20;3\n2;18;11;21;4\n",
            "the column after the name holds whole numbers alone and may be no coordinate",
        ),
        ("name;X;Y;Z;s\nB1;1,234;25;30;1\n", "the comma of '1,234' beside '25' may separate thousands"),
        ("Punkt;Rechts;Hoch;Oben\nB1;1;2;3\n", "line 1: column 'Rechts' is not known"),
        ("name;X [ft];Y [ft];Z [ft];s\nB1;1;2;3;0.1\n", r"column 'X \[ft\]': all lengths of a file have one unit"),
        ("name;X;Y;Z;s(mm)\nB1;1;2;3;5\n", r"column 's\(mm\)': all lengths of a file have one unit"),
        ("name;X;Y;Z;code;s\nB1;1;2;3;4;0.1\n", "column 'code' is not known"),
        ("Name;Y;X;H\nB1;1;2;3\n", "column 'H': in a surveyor's system X may point north"),
        ("1,5,10.5,20,3.5,0.01,0.01\n", "line 1: '1,5' may be one name"),
        ("B2,11.5,21.5,4.5,1,1,1\nB1,1,29,17,112.24,0.01,0.01\n", "line 2: 'B1,1' may be one name"),
        ("1,5,20,3,0.5\n", "line 1: '1,5' may be one name"),
        ("NAME,X,Y,Z,sigma\n0,5,97.092,47.9,141.731,\n", "line 2: 6 cells instead of 5"),
        ("name,X,Y,Z,s\nB1,10,5,20,3,\n", "line 2: 6 cells instead of 5"),
        ("X;Y;Z;s\n1;2;3;0.1\n", "column 'name' is missing"),
        ("name;X;Y;Z;s\n;1;2;3;0.1\n", "line 2: '' is no name"),
        ("name;X;Y;Z;s\n'B1';1;2;3;0.1\n", "line 2: \"'B1'\" is no name"),
        ('name;X;Y;Z;s\n"B1;1;2;3;0.1\n', "line 2: a double quote is not closed"),
        ('name;X;Y;Z;s\n"B"1;1;2;3;0.1\n', "line 2: a double quote is not closed, or text follows"),
        ("name;X;Y;Z;s\nB1;1_000;2;3;0.1\n", "line 2, column x: '1_000' is no number"),
        ("name;X;Y;Z;s\nB1;1.234,5;2;3;0,1\n", r"line 2, column x: '1\.234,5' is no number"),
        ("name;X;Y;Z;s\nB1;1;2;3;0.1\nB1;1;2;4;0.1\n", "line 3: 'B1' is there twice"),
        ("sep=x\nB1x1x2x3x0.1\n", "line 1: sep=x: the separator must be one of"),
        (SEMICOLONS.encode("utf-16")[2:], "is no text file, or UTF-16 without its mark"),
        (b"\x81\xe5;1;2;3;0.1\n", "is text of an unknown encoding; save it as UTF-8"),
    ],
)
def test_what_could_be_read_otherwise_is_refused(text: str | bytes, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern) as refused:
        import_network([_file(tmp_path, text)])
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "ending"),
    [
        ("image;name;x;y;s\n1;K1;0.41;-0.02;0.012\n!16;K1;-0.87;0.5;\n", ".phc"),
        ("name image x y\nB#15 #2 -11.9 13.1\n#7 B#28 4.2 12.1\n", ".phc"),
        ("1;K1\n#2;K1\n", ".eor"),
    ],
)
def test_lines_that_are_left_out_as_comments_are_said(text: str, ending: str, tmp_path: Path) -> None:
    part = read_aicon(_file(tmp_path, text, f"a{ending}"), 0.01)
    assert f"a{ending}: 1 lines of numbers are comments (# or !) and left out" in part.notes


def test_a_blank_that_holds_words_together_is_no_end_of_a_word(tmp_path: Path) -> None:
    """Spreadsheets and web pages write it; in Windows-1252 it is the only letter beyond ASCII of a whole file."""
    path = _file(tmp_path, "name;X;Y;Z;s\nB\xa01;1.5;2;3;0.1\n".encode("cp1252"))
    with pytest.raises(BadInputError, match=r"line 2: 'B\\xa01' is no name"):
        import_network([path])


def test_assumed_encodings_and_hidden_lines_are_said(tmp_path: Path) -> None:
    path = _file(tmp_path, "Hoppkant-Ø;1;2;3;0,1\n#7;1;2;3;0,1\n# Tuesday\n".encode("latin-1"))
    imported = import_network([path])
    assert [point.name for point in imported.network.points] == ["Hoppkant-Ø"]
    assert imported.notes == (
        "balls.csv: is no UTF-8, taken as Windows-1252 (Latin-1): look whether 'Hoppkant-Ø' is right",
        "balls.csv: 1 lines of numbers are comments (# or !) and left out",
    )


@pytest.mark.parametrize(
    "text",
    [
        "1 29.5 32.833 92.37 2\n2 -83.7  159.3 2\n",
        "a,-256.4,-57.7,2638.0\n1,5,33,49.5,31\n",
        "5 6  1962.74  -62.67  35.5\n7  336.259  293.92  130.81\n",
    ],
)
def test_lines_with_other_numbers_of_cells_are_refused_where_columns_have_no_names(text: str, tmp_path: Path) -> None:
    """An empty cell that blanks hide, or a name that holds the separator, would shift the others."""
    with pytest.raises(BadInputError, match=r"line 2: \d cells, and \d in the first line|may be one name"):
        import_network([_file(tmp_path, text, "balls.obc")])


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("B1 10.5  3.5 0.01\nB2 11.5  4.5 0.01\n", "line 1: several blanks at one place, which may be an empty cell"),
        (" 10.5 20.5 3.5 0.01\n", "line 1: several blanks at one place"),
        ("B1 10.5 20.5 3.5 0.01 0.01 \n", "line 1: several blanks at one place"),
        ("K1 7 10.5 20.5 3.5\nK1 8 11.5 21.5 4.5\n", "line 1: 'K1 7' may be one name"),
        ("name X Y Z s\nK1 7 10.5 20.5  0.01\n", "line 2: 'K1 7' may be one name"),
        ("K1 7 10.5 20 3\nK2 8 11 21.5 4\n", "line 1: 'K1 7' may be one name"),
        ("B1,417, 23.3, 66.846, ,,\n", "line 1: 'B1,417' may be one name"),
        ("B1,317,24.5,56,,\nB2,318,25,57.5,,\n", "line 1: 'B1,317' may be one name"),
        ("B2,31.5,-4.25,6.5,,,\nB1,317,24.3,56.846,,,\n", "line 2: 'B1,317' may be one name"),
        (
            "K,20.5,577.136,-132.196,350.3,0.005,0.001\n",
            "line 1: sigmas of 0.001 and 350.3, of which one may be a coord",
        ),
        ("B1,8;115.02;81.264;378.4\na;22;19.264;118.52;423\n", "line 2: 5 cells, and 4 in the first line"),
        ("name   X      Y      Z sX\nP 22.5 12.002  3.5     1\n", "line 2: 'P 22.5' may be one name"),
        ("X Y Z name\n12.5 3.5  7 a\n", "line 2: '7 a' may be one name"),
    ],
)
def test_object_points_whose_cells_may_be_others_are_refused(text: str, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern):
        import_network([_file(tmp_path, text, "points.obc")])


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("2 Ball 1 -130 98.960 0.012\n", "line 1: 'Ball 1' may be one name"),
        ("1 7  98.960 0.012\n", "line 1: several blanks at one place"),
        ("image name x y s\n2 K1 7 4.25 3.5 \n", "line 2: 'K1 7' may be one name"),
        ("2 B1 7 4.25 3.5 0.002\n", "line 1: 'B1 7' may be one name"),
        ("cam1 1 17 4.25 3.5 0.002\ncam1 1 18 4.5 3.5 0.002\n", "line 1: '1 17' may be one name"),
        ("P 30.5 -3 9.7 5.33 0.002\n", "line 1: sigmas of 0.002 and 5.33, of which one may be a coordinate"),
        ("image name x y s\nv1.5  7 12 -3.21 2.56\n", "line 2: '7 12' may be one name"),
    ],
)
def test_image_points_whose_cells_may_be_others_are_refused(text: str, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern):
        import_network([_file(tmp_path, text, "points.phc"), _file(tmp_path, "7 20 0 0\n", "a.ior")], sigma_mm=0.001)


@pytest.mark.parametrize(
    "text",
    [
        "B1   10.5   20.25   3.5   0.01   0.01   0.02\n  B2 11.5 21.25 4.5 0.01 0.01 0.02\n",
        "# point X Y Z sX sY sZ\nB1   10.5   20.25   3.5   0.01   0.01   0.02\nB2 11.5 21.25 4.5 0.01 0.01 0.02\n",
        "nr    X     Y   Z   sX   sY   sZ\nB1 10.5 20.25 3.5 0.01 0.01 0.02\nB2 11.5 21.25 4.5 0.01 0.01 0.02\n",
    ],
)
def test_object_points_in_wide_columns_are_read_where_none_is_empty(text: str, tmp_path: Path) -> None:
    assert _points(_file(tmp_path, text, "points.obc")) == BALLS


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("K1 7 8.5 0.01 -0.02\n", "'K1 7' may be one name"),
        ("B1 8.50 0.010 0\nK1 7 8 0 0\n", "'K1 7' may be one name"),
        ("2,25,42.80,0.37,-0.5\n", "'2,25' may be one name"),
        ("1;5;46.851;-0.467;-0.026\n", "'1;5' may be one name"),
        ("1 12.7 9.36 -0.365 0.193\n", "'1 12.7' may be one name"),
        ("B317 58.55  0.4\n", "line 1: several blanks at one place, which may be an empty cell"),
        ("camera c x0 y0\nP 32.5    29    0.29\n", "line 2: 'P 32.5' may be one name"),
        ("! camera c x0 y0\nP 32,5    29    2,90e-01\n", "line 2: 'P 32,5' may be one name"),
        ("0.399,,a\t12\n", "line 1: '0.399,,a' may be several cells; write one separator"),
        ("camera c x0 y0\nB1  0.199 0.07\n", "line 2: several blanks at one place, which may be an empty cell"),
        ("K,31.5,5.483,0.1,-0.4\n", "'K,31.5' may be one name"),
        ("B7;0;0;0\n", "line 1: c = 0 mm is no principal distance"),
    ],
)
def test_cameras_whose_cells_may_be_others_are_refused(text: str, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern):
        import_network([_file(tmp_path, text, "a.ior")])


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("# image camera x0 y0 z0\nB317 K1 2 0.360  110.377\n", "'K1 2' may be one name"),
        ("1;B17;5;60.263;3.855;\n", "line 1: 6 cells instead of 5"),
        ("sep=\t\nimage;camera;X0;Y0;Z0\n10;B5;-68;37;-57\n", "line 2: 'image;camera;X0;Y0;Z0' may be several cells"),
        ("  9.6 v1.5 32 -144.504 86.718    \n", "line 1: 'v1.5 32' may be one name"),
    ],
)
def test_poses_whose_cells_may_be_others_are_refused(text: str, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern):
        read_aicon(_file(tmp_path, text, "a.eor"), None)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("7,0,0,0,0.005\n8,10,0,0,0.005\n", ["7", "8"]),
        ("B1,0,0,0,0.005\n", ["B1"]),
        ("B1;5;2.5;3;1\nB2;1.5;2;3;1\n", ["B1", "B2"]),
    ],
)
def test_whole_numbers_are_read_where_nothing_else_fits(text: str, names: list[str], tmp_path: Path) -> None:
    assert list(_points(_file(tmp_path, text))) == names


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("dup.obc", "1 10 20 3 0.001\n1 10 20 9 0.001\n2 11 21 4 0.001\n"),
        ("dup.obc", "1 10 20 3\n1 10 20 3\n"),
        ("dup.ior", "1 20 0 0\n1 21 0 0\n"),
        ("dup.eor", "1 7 0 0 0\n1 7 0 0 1\n"),
    ],
)
def test_a_name_twice_in_a_file_is_refused(name: str, text: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="line 2: '1' is there twice"):
        import_network([_file(tmp_path, text, name)])


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("1 7 1.0 2.0\n", "line 1: has x0, y0 alone; write x0, y0, z0, or none of them"),
        ("B1,K;1,2.5,3.5,4.5\n", "line 1: 'B1,K' may be several cells; write one separator in all lines"),
        (
            "image camera omega_deg phi_deg\n1 7 10 20\n",
            "line 2: has omega_deg, phi_deg alone; write omega_deg, phi_deg",
        ),
        (
            "image omega_deg phi_deg kappa_deg omega_gon phi_gon kappa_gon\n1 1 2 3 1 2 3\n",
            "line 2: has angles in two units; remove one",
        ),
    ],
)
def test_half_a_pose_is_refused(text: str, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern):
        import_network([_file(tmp_path, text, "a.eor")])


def test_a_ball_in_two_surveys_is_refused_with_the_difference(tmp_path: Path) -> None:
    first = _file(tmp_path, "B1,10.5,20.5,3.5,0.005\nB2,11,21,4,0.005\n", "day1.csv")
    second = _file(tmp_path, "B1,10.5,20.5,4.5,0.005\nB3,12,22,5,0.005\n", "day2.csv")
    with pytest.raises(BadInputError, match=r"day2.csv: point 'B1' is in .*day1.csv too, 1 apart; keep one of them"):
        import_network([first, second])


def test_a_pose_in_two_files_is_refused_unless_they_agree(tmp_path: Path) -> None:
    camera, points = _file(tmp_path, "7 20 0 0\n", "a.ior"), _file(tmp_path, "1 T1 0 0 0.1 0.1\n", "a.phc")
    poses, other = _file(tmp_path, "1 7 0 0 0\n", "a.eor"), _file(tmp_path, "1 7 0 0 3\n", "b.eor")
    without = _file(tmp_path, "1 7\n", "c.eor")
    with pytest.raises(BadInputError, match=r"b.eor: image '1' is in .*a.eor too, 3 apart"):
        import_network([camera, points, poses, other])
    (image,) = import_network([camera, points, poses, without]).network.images
    assert np.asarray(image.position).tolist() == [0.0, 0.0, 0.0]


#: How a program writes a table: separator, decimal mark, quoting, head, and what stands before it.
_DIALECTS: Final = st.fixed_dictionaries(
    {
        "separator": st.sampled_from((";", "\t", ",", " ")),
        "decimal": st.sampled_from((".", ",")),
        "quoting": st.sampled_from((csv.QUOTE_MINIMAL, csv.QUOTE_ALL, None)),  # None: plainly, without quotes,
        "head": st.booleans(),
        "sep": st.booleans(),
        "encoding": st.sampled_from(("utf-8", "utf-8-sig", "utf-16", "latin-1")),
        "end": st.sampled_from(("\n", "\r\n")),
        "ending": st.sampled_from((".csv", ".obc")),
    }
)
_MEASURED: Final = st.decimals(-200, 200, places=3).map(lambda value: f"{value:.3f}")
_WHOLE: Final = st.integers(-200, 200).map(str)
_VALUES: Final = st.sampled_from((*[_MEASURED] * 12, *[_WHOLE] * 3, st.just(""))).flatmap(lambda cells: cells)
_SIGMA_CELLS: Final = st.sampled_from((*("0.005", "0.01", "0.012") * 4, "1", ""))
_NAMES: Final = st.one_of(
    st.sampled_from(("B1", "Ball 1", "7", "kant Ø", 'B"1', "0317", "1,5", "a;b", "North", "#1", "K1 7")),
    st.text("aB1 ,;.Ø\"'#", min_size=1, max_size=5),
)
_ROWS: Final = st.integers(0, 3).flatmap(
    lambda sigmas: st.lists(
        st.tuples(
            _NAMES,
            *[_VALUES] * 3,
            *[_SIGMA_CELLS] * sigmas,
        ),
        min_size=1,
        max_size=4,
    )
)


def _survey_head(rows: list[tuple[str, ...]]) -> tuple[str, ...]:
    return ("name", "X", "Y", "Z", *{0: (), 1: ("sigma",), 2: ("sX", "sY"), 3: ("sX", "sY", "sZ")}[len(rows[0]) - 4])


def _written(rows: list[tuple[str, ...]], columns: tuple[str, ...], names: int, dialect: dict[str, Any]) -> bytes:
    """The table as a program writes it with Python's csv, or plainly, without any quotes; so many columns are names."""
    out = io.StringIO()
    if dialect["sep"]:
        out.write(f"sep={dialect['separator']}{dialect['end']}")
    head = [columns] if dialect["head"] else []
    body = [(*row[:names], *(cell.replace(".", dialect["decimal"]) for cell in row[names:])) for row in rows]
    if dialect["quoting"] is None:
        out.writelines(dialect["separator"].join(row) + dialect["end"] for row in (*head, *body))
    else:
        form = {"delimiter": dialect["separator"], "quoting": dialect["quoting"], "lineterminator": dialect["end"]}
        csv.writer(out, **form).writerows([*head, *body])
    return out.getvalue().encode(dialect["encoding"])


@given(rows=_ROWS, dialect=_DIALECTS)
def test_a_table_in_any_dialect_is_read_right_or_refused(
    rows: list[tuple[str, ...]], dialect: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> None:
    # Plainly written, a name in quotes is that without them.
    assume(dialect["quoting"] is not None or not any(name.lstrip().startswith('"') for name, *_ in rows))
    path = _file(
        tmp_path_factory.getbasetemp(), _written(rows, _survey_head(rows), 1, dialect), f"any{dialect['ending']}"
    )
    try:
        imported = import_network([path])
    except BadInputError:
        return
    lines = path.read_bytes().decode(dialect["encoding"]).splitlines()[-len(rows) :]
    hidden = [row for row, line in zip(rows, lines, strict=True) if line.lstrip().startswith(("#", "!"))]
    expected = {}
    for name, *cells in rows:
        if (name, *cells) not in hidden:
            xyz = [float(cell) for cell in cells[:3]]  # an empty one is never read
            sigma = [float(cell) for cell in cells[3:]] if any(cells[3:]) else None  # nor are some beside others
            expected[name.strip()] = (xyz, sigma * 3 if sigma is not None and len(sigma) == 1 else sigma)
    assert _points(path) == expected
    if any(all(row[1:]) for row in hidden):
        assert any("are comments" in note for note in imported.notes)


_SMALL: Final = st.decimals(-1, 1, places=3).map(lambda value: f"{value:.3f}")
_POSITIVE: Final = st.one_of(
    st.decimals(4, 60, places=2).map(lambda value: f"{value:.2f}"), st.integers(4, 60).map(str)
)
#: Columns of AICON's files, how many of them are names, and their cells.
_AICON: Final[dict[str, tuple[tuple[str, ...], int, Any]]] = {
    ".phc": (("image", "point", "x", "y", "sx", "sy"), 2, st.tuples(_NAMES, _NAMES, _VALUES, _VALUES, _SIGMA_CELLS)),
    ".ior": (("camera", "c", "x0", "y0"), 1, st.tuples(_NAMES, _POSITIVE, _SMALL, _SMALL)),
    ".eor": (("image", "camera", "X0", "Y0", "Z0"), 2, st.tuples(_NAMES, _NAMES, *[_VALUES] * 3)),
}


@given(data=st.data(), dialect=_DIALECTS, ending=st.sampled_from(tuple(_AICON)))
def test_files_of_aicon_in_any_dialect_are_read_right_or_refused(
    data: st.DataObject, dialect: dict[str, Any], ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    columns, names, cells = _AICON[ending]
    rows = data.draw(st.lists(cells, min_size=1, max_size=4))
    if ending == ".phc":  # the same sigma of x and y, or that of both in one column
        both = data.draw(st.booleans())
        rows = [(*row, row[-1]) if both else row for row in rows]
        columns = columns if both else (*columns[:4], "s")
    assume(all(name.strip() for row in rows for name in row[:names]))
    plain = dialect["quoting"] is None
    assume(not plain or not any(name.lstrip().startswith('"') for row in rows for name in row[:names]))
    path = _file(tmp_path_factory.getbasetemp(), _written(rows, columns, names, dialect), f"any{ending}")
    try:
        part = read_aicon(path, None)
    except BadInputError:
        return
    lines = path.read_bytes().decode(dialect["encoding"]).splitlines()[-len(rows) :]
    read = [row for row, line in zip(rows, lines, strict=True) if not line.lstrip().startswith(("#", "!"))]
    named = [(*(word.strip() for word in row[:names]), *(float(word or "nan") for word in row[names:])) for row in read]
    if ending == ".phc":
        assert [tuple(row) for row in part.observations] == [(*row[:5], row[-1]) for row in named]
    elif ending == ".ior":
        assert {name: [body[key] for key in ("c", "x0", "y0")] for name, body in part.cameras.items()} == {
            name: [abs(values[0]), *values[1:]] for name, *values in named
        }
    else:
        assert {name: (body["camera"], body["X0"]) for name, body in part.images.items()} == {
            name: (camera, None if np.isnan(values).all() else values) for name, camera, *values in named
        }
