"""The centre of mass against the simulated figure, against standing men, and its two uncertainties."""

from typing import Any

import numpy as np
import pytest

from photogrammetry.jumper.centre_of_mass import (
    LANDMARKS,
    POINTS,
    Masses,
    Table,
    centre_of_mass,
    independent,
    stacked,
)
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.pulse import HillPulse
from rig.settings.file import CONFIG
from simrig.world.scenario import load_scenario
from simrig.world.truth import truth

TRAINING = load_scenario(CONFIG / "scenarios" / "training.toml")
JUMPER = TRAINING.jumper
MASSES = Masses(JUMPER.mass_kg, JUMPER.ski_mass_kg, JUMPER.boot_mass_kg)
NONE = np.zeros((1, 45, 45))


def _states() -> list[dict[str, Any]]:
    states = truth(TRAINING, map(HillPulse, range(25, 55, 2)), 30.0)["pulses"]
    return [state for state in states if state["jumper_present"]]


def _points(states: list[dict[str, Any]]) -> Floats:
    every = [{**state["landmarks"], **state["points"]} for state in states]
    return stacked({name: np.array([place[name] for place in every]) for name in POINTS})


@pytest.mark.parametrize("table", Table)
def test_it_is_where_the_simulated_figure_has_it(table: Table) -> None:
    """The figure has de Leva's masses, but puts neck, hands and feet in places of its own: 5 mm at most.

    Of Dempster's table it may be as far off as that says: 3 sigma in every coordinate.
    """
    states = _states()
    points = _points(states)
    for masses, kind in ((None, "body"), (MASSES, "with_equipment")):
        found = centre_of_mass(points, np.repeat(NONE, len(points), axis=0), table, masses)
        error = found.position - np.array([state["centre_of_mass"][kind] for state in states])
        sigma = np.sqrt(np.diagonal(found.table, axis1=1, axis2=2))
        assert (np.abs(error) < 3 * sigma).all()
        if table is Table.DE_LEVA:
            assert np.linalg.norm(error, axis=1).max() < 0.005
        assert 0.003 < sigma.min() < sigma.max() < 0.04
        assert not found.measurement.any()


@pytest.mark.parametrize("table", Table)
def test_standing_men_have_it_above_the_middle(table: Table) -> None:
    """Of a man with the segment lengths of de Leva's men, 1.741 m tall: 54 to 59 % of his height."""
    heights = {"shoulder": 1.44, "elbow": 1.158, "wrist": 0.889, "hip": 0.924, "knee": 0.502, "ankle": 0.07}
    points = np.zeros((1, 15, 3))
    for place, name in enumerate(LANDMARKS):
        points[0, place, 2] = heights[name.split()[1]]
    points[0, 12:, 2] = 1.62, 0.0, 0.0
    height = centre_of_mass(points, NONE, table).position[0, 2] / 1.741
    assert 0.54 < height < 0.59


def test_skis_and_boots_pull_it_down_by_their_share() -> None:
    points = _points(_states()[:1])
    bare, heavy = (centre_of_mass(points, NONE, Table.DE_LEVA, masses).position for masses in (None, MASSES))
    skis = (points[:, 13] + points[:, 14]) / 2
    feet = (points[:, [5, 11]] + points[:, 13:]).mean(axis=1) / 2
    expected = (MASSES.body_kg * bare + 2 * MASSES.ski_kg * skis + 2 * MASSES.boot_kg * feet) / MASSES.total_kg
    assert heavy == pytest.approx(expected, abs=1e-12)


def test_the_sigma_of_measurement_is_that_of_a_weighted_mean() -> None:
    """The same error in all points moves it as far; independent ones average out; 4000 draws agree within 4 %."""
    rng = np.random.default_rng(11)
    points = _points(_states()[:1])
    together = np.asarray(np.kron(np.ones((15, 15)), 0.02**2 * np.eye(3))[None], np.float64)
    for table in Table:
        assert centre_of_mass(points, together, table, MASSES).measurement[0] == pytest.approx(0.02**2 * np.eye(3))
    blocks = np.array([np.diag(rng.uniform(0.005, 0.03, 3) ** 2) for _ in range(15)])[None]
    found = centre_of_mass(points, independent(blocks), Table.DE_LEVA, MASSES)
    draws = points + rng.standard_normal((4000, 15, 3)) * np.sqrt(np.diagonal(blocks, axis1=2, axis2=3))
    scatter = centre_of_mass(draws, np.zeros((4000, 45, 45)), Table.DE_LEVA, MASSES).position.std(axis=0)
    assert scatter == pytest.approx(np.sqrt(np.diagonal(found.measurement[0])), rel=0.04)
    assert (scatter < 0.012).all()


def test_the_sigma_of_the_table_hardly_depends_on_the_measurement_and_covers_the_other_table() -> None:
    states = _states()
    points, exact = _points(states), np.repeat(NONE, len(states), axis=0)
    one, other = (centre_of_mass(points, exact, table, MASSES) for table in Table)
    apart = one.position - other.position
    for found in (one, other):
        variance = np.einsum("na,nab,nb->n", apart, np.linalg.inv(found.table), apart)
        assert (variance <= 4.0 + 1e-9).all(), "half of the difference is one sigma"
    moved = centre_of_mass(points + 0.01, exact, Table.DE_LEVA, MASSES)
    assert moved.table == pytest.approx(one.table, abs=1e-12)
    assert np.abs(moved.position - one.position) == pytest.approx(0.01)


def test_fewer_landmarks_are_refused_with_the_reason() -> None:
    four = {name: np.zeros((1, 3)) for name in ("P1", "P2", "P3", "P4")}
    with pytest.raises(BadInputError, match=r"right shoulder, .* missing; P1..P4 cannot carry it"):
        stacked(four)
    with pytest.raises(BadInputError, match="left knee missing"):
        stacked({name: np.zeros((1, 3)) for name in POINTS if name != "left knee"})
    with pytest.raises(BadInputError, match=r"P1..P4 alone cannot carry"):
        centre_of_mass(np.zeros((1, 4, 3)), np.zeros((1, 12, 12)), Table.DE_LEVA)
    with pytest.raises(BadInputError, match="give the total with boots and skis"):
        Masses(8.0, 3.0, 1.0)


def test_a_pulse_without_one_landmark_has_no_result() -> None:
    points = _points(_states()[:2])
    points[1, 4] = np.nan
    found = centre_of_mass(points, np.zeros((2, 45, 45)), Table.DEMPSTER, MASSES)
    assert np.isfinite(found.position[0]).all()
    assert np.isnan(found.position[1]).all()
    assert np.isnan(found.table[1]).all()
