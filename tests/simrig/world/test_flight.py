import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simrig.world.flight import GRAVITY, STEP_S, Flight, Forces, fly
from simrig.world.keyframes import Curve
from simrig.world.scenario import Hill

START = np.array((0.0, 0.0, 0.0))
SPEEDS = st.tuples(st.floats(5, 40), st.floats(-2, 2), st.floats(-8, 8))
AREAS = st.floats(0.05, 1.5)


def flight(speed: tuple[float, float, float], drag: float, lift: float) -> Flight:
    forces = Forces(68.0, 1.25, Curve.through([(0.0, drag)]), Curve.through([(0.0, lift)]))
    return fly(forces, START, np.array(speed), 1.0)


def energies(path: Flight) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Energy per mass at every step, J/kg."""
    energy: np.ndarray[tuple[int], np.dtype[np.float64]] = (
        path.states[:, 2] * GRAVITY + (path.states[:, 3:] ** 2).sum(axis=1) / 2
    )
    return energy


@given(SPEEDS, st.floats(0, 1))
def test_without_air_the_path_is_a_parabola(speed: tuple[float, float, float], time: float) -> None:
    expected = np.array(speed) * time - np.array((0, 0, GRAVITY / 2)) * time**2
    assert flight(speed, 0, 0).position(time) == pytest.approx(expected, abs=1e-9)


@given(SPEEDS, AREAS)
def test_drag_takes_energy_at_every_step(speed: tuple[float, float, float], drag: float) -> None:
    assert (np.diff(energies(flight(speed, drag, 0))) < 0).all()


@given(SPEEDS, AREAS)
def test_lift_does_no_work(speed: tuple[float, float, float], lift: float) -> None:
    energy = energies(flight(speed, 0, lift))
    assert energy == pytest.approx(energy[0], rel=1e-7)


def test_drag_takes_what_its_formula_says() -> None:
    path = flight((26.0, 0.0, 0.0), 0.5, 0.3)
    power = 1.25 / 2 * 0.5 * 26.0**3 / 68.0
    assert -np.diff(energies(path))[0] / STEP_S == pytest.approx(power, rel=0.01)


@given(AREAS)
def test_lift_carries(lift: float) -> None:
    assert flight((26.0, 0.0, -2.5), 0.4, lift).position(1.0)[2] > flight((26.0, 0.0, -2.5), 0.4, 0).position(1.0)[2]


def test_halving_the_step_changes_nothing_to_speak_of(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = flight((26.0, 0.1, -2.6), 0.5, 0.5).position(0.8)
    monkeypatch.setattr("simrig.world.flight.STEP_S", STEP_S / 2)
    fine = flight((26.0, 0.1, -2.6), 0.5, 0.5).position(0.8)
    assert coarse == pytest.approx(fine, abs=1e-7)


def test_the_knoll_reaches_the_p_point_in_height_and_slope() -> None:
    hill = Hill()
    ground = hill.ground
    assert float(ground(0.0)) == pytest.approx(-hill.table_height_m)
    assert float(ground(hill.p_x_m)) == pytest.approx(hill.p_z_m)
    for x, angle in ((0.0, hill.knoll_angle_deg), (hill.p_x_m, hill.p_angle_deg)):
        slope = float(ground(x + 1e-5) - ground(x)) / 1e-5
        assert slope == pytest.approx(-math.tan(math.radians(angle)), abs=1e-4)


def test_the_knoll_gets_steeper_all_the_way_to_the_p_point() -> None:
    assert (np.diff(Hill().ground(np.linspace(0, 80, 200)), 2) < 0).all()
