"""Planning: both ways to predict agree, the shipped networks give the documented figures, bad files are refused."""

import json
import re
from collections.abc import Sequence
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.camera_model import Lens, linearise
from photogrammetry.planning.description import Description, read_description
from photogrammetry.planning.monte_carlo import simulate
from photogrammetry.planning.plan import Plan, hidden, plan_from
from photogrammetry.planning.prediction import Sigmas, adjusted_plan, predict
from photogrammetry.planning.sight import Obstacle, in_picture
from photogrammetry.planning.step_three import error_free_sights, intersect_flight, intersect_samples
from photogrammetry.reports.document import Drawing
from photogrammetry.reports.plan import plan_report, worst_disagreement
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.file import CONFIG
from rig.settings.strict_toml import read_toml, validate
from svev.cli import main
from tests.photogrammetry.drawn import SVG, bar, chart_scales, parsed, polyline

NETWORKS = CONFIG / "networks"
PAGE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "planning.md"


def _planned(name: str) -> tuple[Plan, Adjustment, Sigmas]:
    plan = plan_from(read_description(NETWORKS / f"{name}.toml"))
    adjusted = adjusted_plan(plan)
    return plan, adjusted, predict(plan, adjusted)


def _flat(sigmas: Sigmas) -> Floats:
    """All sigmas in one row."""
    return np.concatenate([part.ravel() for part in astuple(sigmas)])


@pytest.mark.long
@pytest.mark.parametrize(("name", "samples"), [("hill-1", 4000), ("hill-2", 2000), ("rods", 1000), ("laboratory", 500)])
def test_covariance_and_monte_carlo_agree(name: str, samples: int) -> None:
    """A simulated sigma scatters by 1 / sqrt(2 samples); beyond that there is no systematic difference."""
    plan, adjusted, predicted = _planned(name)
    simulated = simulate(plan, adjusted, samples=samples, seed=4)
    ours, theirs = _flat(predicted), _flat(simulated)
    ratios = theirs[ours > 0.0] / ours[ours > 0.0]
    assert np.abs(ratios - 1.0).max() < 4.5 / np.sqrt(2.0 * samples)
    assert ratios.mean() == pytest.approx(1.0, abs=0.05)
    if plan.network.cameras[0].estimate == ():
        assert worst_disagreement(predicted, simulated) < 0.05
    np.testing.assert_array_equal(theirs == 0.0, ours == 0.0)


@pytest.mark.parametrize("name", ["hill-1", "rods"])
def test_many_flights_at_a_time_equal_one_flight_at_a_time(name: str) -> None:
    plan, adjusted, _ = _planned(name)
    assert plan.flight is not None
    sights, rng, n = error_free_sights(plan, plan.flight), np.random.default_rng(3), 4
    true = intersect_flight(plan.network, adjusted.state, sights)
    noisy = replace(
        sights,
        points=sights.points + rng.normal(0.0, sights.sigma, (n, *sights.points.shape)),
        skis=sights.skis + rng.normal(0.0, sights.sigma, (n, *sights.skis.shape)),
    )
    unknowns = adjusted.problem.unknowns
    steps = np.zeros((n, unknowns.count))
    sigma = np.sqrt(np.diagonal(adjusted.cofactors))[: unknowns.n_poses_end]
    steps[:, : unknowns.n_poses_end] = 0.02 * rng.normal(0.0, sigma, (n, unknowns.n_poses_end))
    states = [unknowns.moved(adjusted.state, step) for step in steps]
    together = State(
        np.stack([state.interior for state in states]),
        np.stack([state.position for state in states]),
        np.stack([state.rotation for state in states]),
        np.stack([state.xyz for state in states]),
    )
    points, angles = intersect_samples(plan.network, together, noisy, true)
    assert not np.isclose(angles[0], true.angles, rtol=0.0, atol=1e-4).all()
    for i, state in enumerate(states):
        alone = intersect_flight(plan.network, state, replace(noisy, points=noisy.points[i], skis=noisy.skis[i]))
        assert points[i] == pytest.approx(alone.points, abs=1e-5)
        assert angles[i] == pytest.approx(alone.angles, abs=1e-5)


def test_the_same_seed_gives_the_same_figures() -> None:
    plan, adjusted, _ = _planned("hill-1")
    once, again, other = (_flat(simulate(plan, adjusted, samples=60, seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(once, again)
    assert np.abs(other - once).max() > 0.0


def test_propagation_equals_the_analytic_one() -> None:
    """Intersected point: dX = -(B^T B)^-1 B^T (e + A dO), A and B being derivatives of the collinearity equations."""
    plan, adjusted, predicted = _planned("hill-1")
    assert plan.flight is not None
    state, unknowns = adjusted.state, adjusted.problem.unknowns
    position, which = 4, 1
    target = np.tile(plan.flight.points[position, which], (3, 1))
    interior = np.array([camera.interior for camera in plan.network.cameras])
    lens = Lens(interior, np.zeros(3), np.zeros(3, dtype=bool))
    lines = linearise(lens, state.rotation, state.position, target, np.zeros((3, 2)))
    by_point = lines.by_point.reshape(6, 3) / plan.sigma
    by_pose = np.zeros((6, unknowns.n_poses_end))
    for image in range(3):
        by_pose[2 * image : 2 * image + 2, unknowns.pose[image]] = lines.by_pose[image] / plan.sigma
    alone = np.linalg.inv(by_point.T @ by_point)
    carried = alone @ by_point.T @ by_pose
    full = alone + carried @ adjusted.cofactors[: unknowns.n_poses_end, : unknowns.n_poses_end] @ carried.T
    assert predicted.points[position, which] == pytest.approx(np.sqrt(np.diagonal(full)), rel=1e-4)


def test_helmets_as_tie_points_help_the_cameras() -> None:
    _, _, alone = _planned("hill-1")
    _, _, tied = _planned("hill-2")
    assert np.all(tied.positions < alone.positions)
    assert np.all(tied.points <= alone.points)


def _rows(title: str) -> list[list[float]]:
    """Numbers of the table under a heading of the page, without those in brackets and without text."""
    part = PAGE.read_text().split(f"## {title}\n", 1)[1].split("\n## ", 1)[0]
    rows = [line.split("|")[2:-1] for line in part.splitlines() if re.search(r"\d\.\d", line) and line.startswith("|")]
    return [[float(number) for cell in row for number in re.findall(r"\d+\.\d*", cell)] for row in rows]


def test_the_documented_table_1_is_what_the_networks_give() -> None:
    _, _, laboratory = _planned("laboratory")
    _, _, hill = _planned("hill-1")
    ours = np.hstack([laboratory.interior[:, :3], 10.0 * hill.positions])
    documented = np.array([row[6:12] for row in _rows("Table 1: cameras")])
    assert documented[:, :3] == pytest.approx(ours[:, :3], abs=0.051)
    assert documented[:, 3:] == pytest.approx(ours[:, 3:], abs=0.0051)


def test_the_documented_table_2_is_what_the_networks_give() -> None:
    documented = np.array(_rows("Table 2: jumper points, and the verdict of section 6")).reshape(-1, 6)
    ours = [10.0 * _planned(name)[2].points.mean(axis=1)[[0, 8, 16]] for name in ("hill-1", "hill-2")]
    assert documented[:6, 3:] == pytest.approx(np.concatenate(ours), abs=0.0051)


def test_the_documented_angles_are_what_the_networks_give() -> None:
    documented = np.array(_rows("What is predicted"))
    for row, name in zip(documented, ("hill-2", "rods"), strict=True):
        _, _, predicted = _planned(name)
        ours = [*np.degrees(predicted.body[8, :5]), 10.0 * predicted.body[8, 5], predicted.speed[8]]
        assert row == pytest.approx(ours, abs=0.0051)


def test_the_documented_verdict_is_what_the_networks_give() -> None:
    documented = np.array(_rows("Section 6: rods"))
    description = read_toml(NETWORKS / "rods.toml")
    cases: list[dict[str, Any]] = [description]
    plumb = json.loads(json.dumps(description))
    plumb["sigma"]["rod_verticality"] = 0.001
    levelled = json.loads(json.dumps(description))
    levelled["differences"] += [
        {"start": start, "end": end, "axis": axis, "sigma": 0.01}
        for start, end, axes in (("P0", "R1-1", "XYZ"), ("R1-1", "R2-1", "XZ"))
        for axis in axes
    ]
    cases += [plumb, levelled]
    plans = [plan_from(validate(Description, case, "rods")) for case in cases]
    plans.append(_with_observed_poses(plans[0]))
    for row, plan in zip(documented, plans, strict=True):
        points = predict(plan, adjusted_plan(plan)).points.mean(axis=1)[[0, 8, 16]]
        assert row == pytest.approx(10.0 * points.ravel(), abs=0.0051)
    assert documented[-1].mean() == pytest.approx(0.165, abs=0.0051)
    known = tuple(replace(camera, estimate=()) for camera in plans[-1].network.cameras)
    plan = replace(plans[-1], network=replace(plans[-1].network, cameras=known))
    assert 10.0 * predict(plan, adjusted_plan(plan)).points.mean() == pytest.approx(0.13, abs=0.0051)


def _with_observed_poses(plan: Plan) -> Plan:
    """The plan with the pseudo-observations of appendix D.2: poses to 0.5 dm and 0.1 gon."""
    position, angles = np.full(3, 0.05), np.full(3, 0.1 * np.pi / 200.0)
    images = tuple(replace(image, sigma_position=position, sigma_angles=angles) for image in plan.network.images)
    return replace(plan, network=replace(plan.network, images=images))


#: As printed: camera positions of table 1, table 2 (dm), and the interior orientations of table 1 (px).
_POSITIONS = np.array([[0.43, 0.48, 0.42], [0.44, 0.52, 0.39], [0.84, 0.69, 0.72]])
_POINTS = np.array(
    [
        *([0.25, 0.20, 0.15], [0.15, 0.15, 0.15], [0.25, 0.25, 0.20]),
        *([0.15, 0.15, 0.10], [0.10, 0.10, 0.10], [0.20, 0.20, 0.15]),
    ]
)
_INTERIOR = np.array([[1.9, 3.8, 3.8], [2.0, 3.8, 3.7], [5.0, 10.0, 11.0]])


def _misfit(ours: Floats, printed: Floats) -> float:
    return float(np.sqrt(np.mean(np.log(ours / printed) ** 2)))


def _tables(descriptions: Sequence[dict[str, Any]]) -> tuple[float, int]:
    """Misfit of the camera positions, and how many of the 18 figures of table 2 are within rounding."""
    found = []
    for case in descriptions:
        plan = plan_from(validate(Description, case, "hill"))
        found.append(predict(plan, adjusted_plan(plan)))
    points = np.concatenate([10.0 * each.points.mean(axis=1)[[0, 8, 16]] for each in found])
    return _misfit(10.0 * found[0].positions, _POSITIONS), int((np.abs(points - _POINTS) < 0.0251).sum())


def test_the_documented_other_hill_is_nearer_to_table_2() -> None:
    here = [read_toml(NETWORKS / f"hill-{i}.toml") for i in (1, 2)]
    there = json.loads(json.dumps(here))
    for description in there:
        for camera, azimuth in zip(description["cameras"], np.radians((-82.0, -62.0, -40.0)), strict=True):
            (image,) = camera["images"]
            sight = 0.9 * np.subtract(image["X0"], image["look_at"])
            turned = np.hypot(*sight[:2]) * np.array((np.cos(azimuth), np.sin(azimuth)))
            image["look_at"] = [9.5, 0.0, -3.0]
            image["X0"] = [float(x) for x in np.add(image["look_at"], (*turned, sight[2]))]
        for ball in description["balls"]:
            x, y, z = ball["X"]
            ball["X"] = [2.0 + 9.0 * (x - 0.5) / 17.5, y, z]
        plan = plan_from(validate(Description, description, "hill"))
        assert plan.flight is not None
        seen = [plan.flight.points, plan.flight.skis, np.array([ball["X"] for ball in description["balls"]])]
        cameras, images = plan.network.cameras, plan.network.images
        assert all(in_picture(cameras[image.camera], image, xyz)[1].all() for image in images for xyz in seen)
    text = " ".join(PAGE.read_text().split())
    misfit, cells = _tables(here)
    nearer, more = _tables(there)
    assert f"{more} of the 18 figures" in text
    assert f"({cells} above)" in text
    assert f"root mean square of ln(ours / printed): {nearer:.2f} for {misfit:.2f})" in text


def test_the_documented_other_frame_is_nearer_to_table_1() -> None:
    here = read_toml(NETWORKS / "laboratory.toml")
    there = json.loads(json.dumps(here))
    grid = np.stack(np.meshgrid((-0.25, 0.0, 0.25), (-0.25, 0.0, 0.25), (-0.15, 0.0, 0.15)), axis=-1).reshape(-1, 3)
    there["balls"] = [{"name": f"F{i}", "role": "tie", "X": xyz} for i, xyz in enumerate(grid.tolist())]
    for camera, distance, aside in zip(there["cameras"], (2.0, 2.0, 4.0), (45.0, 45.0, 85.0), strict=True):
        for image, azimuth, roll in zip(
            camera["images"], np.radians((-aside, 0.0, aside)), (90.0, 0.0, 90.0), strict=True
        ):
            image["X0"] = [float(distance * np.sin(azimuth)), float(-distance * np.cos(azimuth)), 0.0]
            image["roll_deg"] = roll
    found = []
    for case in (here, there):
        plan = plan_from(validate(Description, case, "laboratory"))
        found.append(predict(plan, adjusted_plan(plan)).interior[:, :3])
    text = " ".join(PAGE.read_text().split())
    misfit, nearer = (_misfit(sigmas, _INTERIOR) for sigmas in found)
    assert f"root mean square of ln(ours / printed): {misfit:.2f}." in text
    lists = [", ".join(f"{sigma:.1f}" for sigma in column) for column in found[1].T]
    assert f"it is {nearer:.2f}: c {lists[0]}; x0 {lists[1]}; y0 {lists[2]}." in text


def test_the_command_prints_tables_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(NETWORKS / "hill-2.toml"), "--samples", "100"]) == 0
    table = capsys.readouterr().out
    assert "hill, alternative 2" in table
    assert re.search(r"^  17  +0\.0", table, re.MULTILINE)
    assert main(["plan", str(NETWORKS / "hill-1.toml"), "--samples", "100", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["format"] == "svev-plan/1"
    assert len(result["covariance"]["positions"]) == 17
    assert result["worst_disagreement"] < 0.3


@pytest.mark.parametrize("name", ["hill-2", "rods"])
def test_curves_and_rings_are_the_two_predictions(name: str) -> None:
    plan, adjusted, predicted = _planned(name)
    simulated = simulate(plan, adjusted, samples=100, seed=2)
    report = plan_report(plan, adjusted, predicted, simulated, 100)
    drawings = {d.caption.split(";")[0]: d.svg for s in report.sections for d in s.parts if isinstance(d, Drawing)}
    of_body = [(sigmas.body, sigmas.speed[:, None]) for sigmas in (predicted, simulated)]
    (ours, our_speed), (theirs, their_speed) = of_body
    expected = {
        "Mean of P1, P2, P3, P4, sigma of X, Y, Z": (predicted.points.mean(axis=1), simulated.points.mean(axis=1)),
        "P2, sigma of X, Y, Z": (predicted.points[:, 1], simulated.points[:, 1]),
        "Sigma of alpha, beta, gamma": (np.degrees(ours[:, :3]), np.degrees(theirs[:, :3])),
        "Sigma of dphi and phi": (np.degrees(ours[:, 3:5]), np.degrees(theirs[:, 3:5])),
        "Sigma of the height of O, midway between the bindings": (ours[:, 5:], theirs[:, 5:]),
        "Sigma of the speed of O to the next position": (our_speed, their_speed),
    }
    for caption, (curves, rings) in expected.items():
        tree = parsed(drawings[caption])
        x, y = chart_scales(tree)
        lines = [polyline(element) for element in tree.findall(f"{SVG}polyline")]
        near = 0.002 * max(curves.max(), rings.max())
        for column, line in zip(curves.T, lines, strict=True):
            assert [x(place) for place in line[:, 0]] == pytest.approx(np.arange(1.0, len(column) + 1.0), abs=0.02)
            assert [y(place) for place in line[:, 1]] == pytest.approx(column, abs=near)
        drawn = [y(float(ring.attrib["cy"])) for ring in tree.findall(f"{SVG}circle[@fill='none']")]
        assert drawn == pytest.approx(rings.T.ravel(), abs=near)


def test_the_drawing_of_a_plan_has_predicted_ellipses() -> None:
    plan, adjusted, predicted = _planned("hill-1")
    report = plan_report(plan, adjusted, predicted, predicted, 100)
    network = next(section for section in report.sections if section.title == "Network")
    above = next(d for d in network.parts if isinstance(d, Drawing) and "jumper" in d.caption and "above" in d.caption)
    tree = parsed(above.svg)
    said = re.search(r"([\d.]+) times as large", above.caption)
    assert said is not None
    radii = [float(e.attrib["rx"]) * bar(tree)[0] / float(said.group(1)) for e in tree.findall(f"{SVG}ellipse")]
    balls, flight = np.array(radii[:21]), np.array(radii[21:]).reshape(5, 4)
    variance = np.append(np.diagonal(adjusted.cofactors), 0.0)
    of_balls = np.sqrt(variance[adjusted.problem.unknowns.point])
    assert np.all(balls >= 0.98 * of_balls[:, :2].max(axis=1))
    assert np.all(balls <= 1.02 * np.hypot(of_balls[:, 0], of_balls[:, 1]))
    shown = predicted.points[::4]
    assert np.all(flight >= 0.98 * shown[:, :, :2].max(axis=2))
    assert np.all(flight <= 1.02 * np.hypot(shown[:, :, 0], shown[:, :, 1]))


def test_the_command_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "plan"
    assert main(["plan", str(NETWORKS / "rods.toml"), "--samples", "100", "--report", str(folder), "--json"]) == 0
    out = capsys.readouterr()
    assert json.loads(out.out)["covariance"]["positions"][0]["body"]["phi_deg"] > 0.1
    assert "protocol.html" in out.err
    page = (folder / "protocol.html").read_text()
    assert set(re.findall(r"\w+://[^\"' <]+", page)) == {"http://www.w3.org/2000/svg"}
    assert "Sigma of alpha, beta, gamma" in page
    assert "speed (m/s)" in (folder / "protocol.txt").read_text()


def test_a_jumper_without_skis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = re.sub(r"^(skis\.|stick).*\n", "", (NETWORKS / "hill-1.toml").read_text(), flags=re.MULTILINE)
    (tmp_path / "network.toml").write_text(text)
    assert main(["plan", str(tmp_path / "network.toml"), "--samples", "100"]) == 0
    table = capsys.readouterr().out
    assert "jumper" in table
    assert "skis" not in table
    assert "body" not in table


def test_the_same_errors_of_two_places_cancel_in_the_speed() -> None:
    """Rods give a poor scale and horizontal: places have large errors, but successive places have the same ones."""
    plan, _, predicted = _planned("rods")
    assert plan.flight is not None
    assert plan.flight.stick is not None
    of_origin = predicted.points[:, 2:, 0].mean() / np.sqrt(2.0)  # as if P3 and P4 erred apart from each other
    assert predicted.speed.max() < 0.3 * plan.flight.stick.rate_hz * np.sqrt(2.0) * of_origin
    # what the rays alone leave: the hill with all orientations known
    hill, _, known = _planned("hill-1")
    assert hill.flight is not None
    alone = intersect_flight(hill.network, adjusted_plan(hill).state, error_free_sights(hill, hill.flight))
    rays = alone.points_covariance.reshape(17, 4, 3, 3)[:, 2:]
    own = 0.25 * rays.sum(axis=1)
    along = np.diff(hill.flight.points[:, 2:].mean(axis=1), axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    floor = 30.0 * np.sqrt(np.einsum("ti,tij,tj->t", along, own[1:] + own[:-1], along))
    assert np.all(known.speed > floor)
    assert known.speed == pytest.approx(floor, rel=0.02)


def test_angles_between_parts_of_the_jumper_need_no_survey() -> None:
    """Section 6: alpha, beta and gamma need no survey; the slope of the skis needs the horizontal."""
    _, _, hill = _planned("hill-2")
    _, _, rods = _planned("rods")
    assert rods.body[:, :3] == pytest.approx(hill.body[:, :3], rel=0.06)
    assert np.all(rods.body[:, 4] > 2.0 * hill.body[:, 4])


def test_weak_camera_parameters_settle() -> None:
    """Decentring beside the principal point: plain Gauss-Newton oscillates without end in some of these samples."""
    description = read_toml(NETWORKS / "laboratory.toml")
    for camera in description["cameras"]:
        camera["estimate"] = ["c", "x0", "y0", "a1", "b1", "b2"]
    plan = plan_from(validate(Description, description, NETWORKS / "laboratory.toml"))
    adjusted = adjusted_plan(plan)
    simulated = simulate(plan, adjusted, samples=80, seed=1)
    assert simulated.positions == pytest.approx(predict(plan, adjusted).positions, rel=4.5 / np.sqrt(160.0))


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('length_unit = "m"', 'length_unit = "m"\ndatums = "inner"', 'unknown key "datums"; did you mean "datum"?'),
        (", control = 0.012", "", "sigma.control is missing, but there are control balls; add it"),
        ('name = "B2"', 'name = "B1"', 'two targets are called "B1"; rename one'),
        ("look_at = [8.1, 0.0, -2.9]", "look_at = [-21.7, -30.9, -2.9]", "looks straight up, straight down or nowhere"),
        ('tie = ["P1"]', 'tie = ["P9"]', 'tie names "P9"'),
        ('hip = "P2"', 'hip = "P7"', 'stick.hip names "P7"; the jumper\'s points are P1, P2, P3, P4'),
        ('left = "L2"', 'left = "P4"', 'stick.left names "P4"; the jumper\'s skis are L1, L2'),
        ("[2.6, 0.0, ", "[200.6, 0.0, ", "P1 at position 1 of the path is in 0 images; aim the cameras"),
    ],
)
def test_bad_networks_are_refused(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    text = (NETWORKS / "hill-2.toml").read_text()
    assert old in text
    path = tmp_path / "network.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(BadInputError, match=re.escape(complaint)) as caught:
        plan_from(read_description(path))
    assert "\n" not in str(caught.value)


def test_what_is_not_determined_is_said_with_exit_code_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (NETWORKS / "hill-1.toml").read_text().replace('role = "control"', 'role = "tie"')
    (tmp_path / "network.toml").write_text(text)
    assert main(["plan", str(tmp_path / "network.toml")]) == 3
    assert "not solvable" in capsys.readouterr().err


def test_an_obstacle_hides_what_is_behind_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A tower between K2 and the ball B9, and nothing but that ball and parts of the flight behind it."""
    text = (NETWORKS / "hill-1.toml").read_text()
    plan, _, predicted = _planned("hill-1")
    k2, ball = plan.network.images[1].position, next(p.xyz for p in plan.network.points if p.name == "B9")
    middle = 0.8 * np.asarray(k2) + 0.2 * np.asarray(ball)
    tower = f'[[obstacles]]\nname = "tower"\ncorner = {(middle - 0.1).tolist()}\nopposite = {(middle + 0.1).tolist()}\n'
    (tmp_path / "tower.toml").write_text(text.replace("[[cameras]]", tower + "[[cameras]]", 1))
    hiding = plan_from(read_description(tmp_path / "tower.toml"))
    rays = {(i, p) for i, p in zip(plan.network.observations.image, plan.network.observations.point, strict=True)}
    left = {(i, p) for i, p in zip(hiding.network.observations.image, hiding.network.observations.point, strict=True)}
    names = {(plan.network.images[i].name, plan.network.points[p].name) for i, p in rays - left}
    assert ("K2-1", "B9") in names
    assert {image for image, _ in names} == {"K2-1"}
    assert len(names) < 5
    assert {name for name in hidden(hiding)["K2-1"] if " at " not in name} == {ball for _, ball in names}
    assert not hidden(plan)
    with_tower = predict(hiding, adjusted_plan(hiding))
    assert np.all(with_tower.positions >= predicted.positions)
    assert with_tower.positions[1].sum() > predicted.positions[1].sum()
    assert main(["plan", str(tmp_path / "tower.toml"), "--samples", "100"]) == 0
    assert "hidden from K2-1: B9" in capsys.readouterr().out
    behind = tower.replace(str((middle + 0.1).tolist()), str((middle - 0.1).tolist()))
    (tmp_path / "flat.toml").write_text(text.replace("[[cameras]]", behind + "[[cameras]]", 1))
    with pytest.raises(BadInputError, match='obstacle "tower" is flat'):
        read_description(tmp_path / "flat.toml")


def test_a_box_hides_along_any_direction() -> None:
    box = Obstacle("box", np.array([-1.0, -1.0, -1.0]), np.array([1.0, 1.0, 1.0]))
    eye = np.array([-5.0, 0.0, 0.0])
    ahead = np.array(
        [[5.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [5.0, 5.0, 0.0], [-9.0, 0.0, 0.0], [5.0, 0.0, 1.9]]
    )
    assert box.hides(eye, ahead).tolist() == [True, True, False, False, False, True]
    rng = np.random.default_rng(1)
    eyes, ends = rng.uniform(-4.0, 4.0, (2, 300, 3))
    along = np.linspace(0.0, 1.0, 2001)[:, None]
    for one, other in zip(eyes, ends, strict=True):
        depth = (1.0 - np.abs(one + along * (other - one)).max(axis=1)).max()  # how far the way goes into the box
        if abs(depth) > 0.01:
            assert bool(box.hides(one, other)) == (depth > 0.0)
