"""The report as a record: origin, assumptions, orientations, every observation with its reliability, what is gone."""

import hashlib
import json
import re
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.adjustment.run import adjust
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Role
from photogrammetry.reports.document import Table
from photogrammetry.reports.record.digits import residual, with_sigma
from photogrammetry.reports.record.strength import coverage_parts, intersection_angles
from photogrammetry.reports.result_extras import with_detectable
from photogrammetry.reports.result_file import outcome_to_json
from svev.cli import main
from tests.photogrammetry.synthetic import SIZE, hill, lab_frame, rods, with_state

Rows = dict[str, list[str]]


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hill with one wrong survey point and one wrong image point, oriented with calibrated cameras."""
    folder = tmp_path_factory.mktemp("record")
    network = hill(6, helmets=17).network
    points = list(network.points)
    points[4] = replace(points[4], xyz=np.asarray(points[4].xyz, dtype=float) + np.array([0.3, -0.2, 0.1]))
    xy = network.observations.xy.copy()
    xy[8] += 25.0
    spoilt = replace(network, points=tuple(points), observations=replace(network.observations, xy=xy))
    write_network(spoilt, folder / "hill.json")
    zeros = dict.fromkeys(("x0", "y0", "a2", "a3", "b1", "b2", "c1", "c2", "r0"), 0.0)
    cameras = {
        name: zeros | {"a1": 1e-12, "c": c, "distortion": "projected"}
        for name, c in (("K1", 1419.7), ("K2", 1421.7), ("K3", 2493.3))
    }
    calibration = {"format": "svev-adjustment/1", "converged": True, "cameras": cameras}
    (folder / "cameras.json").write_text(json.dumps(calibration))
    command = ["orient", str(folder / "hill.json"), "--calibration", str(folder / "cameras.json")]
    command += ["--force", "-o", str(folder / "poses.json"), "--report", str(folder / "report"), "--covariance", "B1*"]
    assert main([*command, "--detectable"]) == 0
    return folder


def _sections(folder: Path) -> dict[str, str]:
    text = (folder / "report" / "protocol.txt").read_text()
    parts = re.split(r"\n\n(.+)\n-+\n", text)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def _rows(section: str, after: str = "") -> Rows:
    """The rows of the first table after some words, by their first cell."""
    lines = section[section.index(after) :].splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith("  ")) + 1
    rows: Rows = {}
    for line in lines[begin:]:
        if not line.startswith("  "):
            break
        rows.setdefault(line.split()[0], []).extend(re.split(r"\s{2,}", line.strip())[1:])
    return rows


def test_origin_names_files_with_their_checksums(record: Path) -> None:
    origin = _sections(record)["Origin"]
    for name in ("hill.json", "cameras.json", "poses.json"):
        assert f"{record / name}  {hashlib.sha256((record / name).read_bytes()).hexdigest()}" in origin
    assert f"svev {version('svev')}" in origin
    assert re.search(r"made \d{4}-\d\d-\d\d \d\d:\d\d:\d\d\+00:00", origin)
    assert "svev orient --covariance B1* --detectable --alternative 1" in origin
    page = (record / "report" / "protocol.html").read_text()
    assert hashlib.sha256((record / "poses.json").read_bytes()).hexdigest() in page
    assert "Name and signature" in _sections(record)["Signature"]


def test_origin_tells_only_options_that_were_given(record: Path, tmp_path: Path) -> None:
    command = [
        "adjust",
        str(record / "hill.json"),
        "-o",
        str(tmp_path / "all.json"),
        "--report",
        str(tmp_path / "report"),
    ]
    assert main(command) == 0
    assert "\nsvev adjust\n" in _sections(tmp_path)["Origin"]


def test_what_was_assumed_stands_before_what_was_found(record: Path) -> None:
    sections = _sections(record)
    assert list(sections).index("Assumed a priori") < list(sections).index("Poses")
    assumed = _rows(sections["Assumed a priori"])
    assert assumed["image"][-4:] == [
        str(len(json.loads((record / "poses.json").read_text())["observations"])),
        "0.33",
        "0.33",
        "px",
    ]
    assert "interior orientations held as they are given, free of error: K1, K2, K3" in sections["Assumed a priori"]
    assert "agrees: the observations agree with their sigmas" in sections["Global test"]


def test_the_interior_orientation_in_use_is_whole(record: Path) -> None:
    interior = _sections(record)["Interior orientation"]
    for name in ("c", "x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2", "r0"):
        assert re.search(rf"  K3 {name} .*held", interior)
    assert re.search(r"K1 a1 +1e-12 ", interior)
    assert "K1 projected, 640 x 480 px" in interior


def test_rotations_stand_as_matrix_and_as_angles(record: Path) -> None:
    result = json.loads((record / "poses.json").read_text())["images"]["hill-2"]
    poses = _sections(record)["Poses"]
    angles = [float(x) for x in _rows(poses, "Degrees")["hill-2"]]
    turns = [rotation_from_vector(np.radians(x) * np.eye(3)[i]) for i, x in enumerate(angles[0:6:2])]
    matrix = np.array(result["R"])
    assert np.abs(turns[0] @ turns[1] @ turns[2] - matrix).max() < np.radians(max(angles[1:6:2]))
    written = [float(x) for x in _rows(poses, "Rotations")["hill-2"] if x not in {"X", "Y", "Z"}]
    assert np.abs(np.array(written).reshape(3, 3) - matrix).max() < 1e-5
    assert angles[6:] == pytest.approx(np.degrees(result["sigma_angles"]), rel=0.06)
    place = [float(x) for x in _rows(poses, "Projection")["hill-2"][1:]]
    assert place[0:6:2] == pytest.approx(result["X0"], abs=max(result["sigma_X0"]))
    assert place[1:6:2] == pytest.approx(result["sigma_X0"], rel=0.06)


def test_every_observation_stands_there_and_what_was_taken_out_too(record: Path) -> None:
    result = json.loads((record / "poses.json").read_text())
    residuals = _sections(record)["Residuals"]
    (gone,) = (g for g in result["removed"] if g["kind"] == "image")
    for image in result["images"]:
        rows = _rows(residuals, f"Image {image}:")
        seen = {o["point"]: o for o in result["observations"] if o["image"] == image}
        assert set(rows) == set(seen) | ({gone["point"]} if gone["image"] == image else set())
        for point, o in seen.items():
            cells = rows[point]
            assert [float(x) for x in cells[2:4]] == pytest.approx([o["vx"], o["vy"]], abs=6e-4)
            assert [float(x) for x in cells[4:6]] == pytest.approx([o["rx"], o["ry"]], abs=6e-3)
            assert [float(x) for x in cells[8:10]] == pytest.approx(o["detectable"], rel=6e-3)
            assert float(cells[10]) == pytest.approx(max(o["effect"]), rel=6e-3)
        if gone["image"] == image:
            assert rows[gone["point"]][4] == "taken out"
            assert list(rows).index(gone["point"]) < len(rows) - 1  # where it stands
            assert abs(float(rows[gone["point"]][2])) == pytest.approx(25.0, abs=3.0)
    survey = _rows(residuals, "Survey")
    assert survey["B5"][0] == "taken out"
    assert [float(x) for x in survey["B5"][1:4]] == pytest.approx(result["check_points"]["B5"]["delta"], abs=1e-3)
    for entry in result["control"]:
        cells = survey[entry["point"]]
        assert [float(x) for x in cells[1:4]] == pytest.approx(entry["v"], abs=6e-5)
        assert [float(x) for x in cells[4:7]] == pytest.approx(entry["r"], abs=6e-3)
        assert [float(x) for x in cells[7:10]] == pytest.approx(entry["w"], abs=0.06)
        assert [float(x) for x in cells[10:13]] == pytest.approx(entry["detectable"], rel=6e-3)


def test_joint_covariance_and_means_are_there(record: Path) -> None:
    result, sections = json.loads((record / "poses.json").read_text()), _sections(record)
    names = result["joint_covariance"]["points"]
    assert names[0] == "B1"
    lines = [line.split() for line in sections["Joint covariance"].splitlines()[2:]]
    assert len(lines) == len(names) * (len(names) + 1) // 2
    block = np.array(result["joint_covariance"]["covariance"])[:3, 3:6]
    assert [float(x) for x in lines[1][2:]] == pytest.approx(block.ravel(), rel=1e-3)
    ties = np.array([result["points"][n]["sigma"] for n in result["points"] if n[0] in "TH"])
    means = re.search(r"sigma of tie points +\d+ +(\S+) +(\S+) +(\S+)", sections["Points"])
    assert means is not None
    assert [float(x) for x in means.groups()] == pytest.approx(np.sqrt(np.mean(ties**2, axis=0)), rel=6e-3)


@pytest.mark.parametrize("case", ["image", "control", "distance"])
def test_an_error_that_the_tests_just_miss_moves_the_result_as_far_as_is_said(case: str) -> None:
    """A small part of it is put in, and the network is adjusted again; small residuals keep the equations linear."""
    part = 0.01
    network = (hill(1, 0.05) if case == "control" else rods(1, 0.05)).network
    outcome = adjust(network)
    a = outcome.adjustment
    result = with_detectable(outcome_to_json(outcome), a)
    points = [
        given if given.role is not Role.TIE else replace(given, xyz=xyz)
        for given, xyz in zip(network.points, a.state.xyz, strict=True)
    ]
    observations, distances = network.observations, list(network.distances)
    if case == "image":
        entry, at = result["observations"][30], 0
        xy = observations.xy.copy()
        xy[30, at] += part * entry["detectable"][at]
        observations = replace(observations, xy=xy)
    elif case == "control":
        entry, at = result["control"][3], 1
        step = np.array([0.0, part * entry["detectable"][at], 0.0])
        points[3] = replace(points[3], xyz=np.asarray(points[3].xyz, dtype=float) + step)
    else:
        entry = {key: [value] for key, value in result["distances"][0].items()}
        at = 0
        distances[0] = replace(distances[0], value=distances[0].value + part * entry["detectable"][at])
    spoilt = replace(
        with_state(network, a.state), points=tuple(points), observations=observations, distances=tuple(distances)
    )
    again = adjust(spoilt).adjustment.state
    moved = np.linalg.norm(np.vstack((again.xyz - a.state.xyz, again.position - a.state.position)), axis=1)
    names = [*(f"point {p.name}" for p in network.points), *(f"image {i.name}" for i in network.images)]
    assert names[int(np.argmax(moved))] == entry["effect_on"][at]
    assert moved.max() == pytest.approx(part * entry["effect"][at], rel=0.02)


def test_intersection_angles_and_coverage() -> None:
    a = adjust(hill(1).network).adjustment
    angles = intersection_angles(a)
    away = [a.state.xyz[0] - place for place in a.state.position]
    pairs = [(away[i], away[k]) for i, k in ((0, 1), (0, 2), (1, 2))]
    met = [np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other))) for one, other in pairs]
    assert np.degrees(angles[0]) == pytest.approx(90.0 - min(abs(90.0 - angle) for angle in met))
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(SIZE) / 4.0
    problem = a.problem
    xy = np.resize(corners, problem.xy.shape)
    table = coverage_parts(replace(a, problem=replace(problem, xy=xy)))[1]
    assert isinstance(table, Table)
    assert table.rows[0][2:] == ("25%", "50%")


def test_digits_follow_the_sigma() -> None:
    assert with_sigma(1419.73456, 1.87) == ("1419.7", "1.9")
    assert with_sigma(12.3456789, 0.00234) == ("12.3457", "0.0023")
    assert with_sigma(2.0456e-8, 1.3e-10) == ("2.046e-08", "1.3e-10")
    assert with_sigma(1234567.8, 250.0) == ("1234568", "250")
    assert with_sigma(0.0, 0.0) == ("0", "-")
    assert residual(0.123456, 0.33) == "0.123"


def test_a_calibration_tells_its_scale_and_what_it_can_find(tmp_path: Path) -> None:
    write_network(lab_frame(2, points=20).network, tmp_path / "frame.json")
    command = [
        "calibrate",
        str(tmp_path / "frame.json"),
        "--force",
        "-o",
        str(tmp_path / "cameras.json"),
        "--detectable",
    ]
    assert main([*command, "--report", str(tmp_path / "report")]) == 0
    result = json.loads((tmp_path / "cameras.json").read_text())
    assert len(result["observations"][0]["detectable"]) == len(result["observations"][0]["effect"]) == 2
    text = (tmp_path / "report" / "protocol.txt").read_text()
    assert "7 inner constraints over all points; nothing gives the scale" in text
    assert not re.search(r"\bm\b", text)  # no metres
    assert "units without a scale" in text
