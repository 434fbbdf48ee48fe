"""Measure here next: the mark that takes most off the covariance of the paths."""

import time

import numpy as np
import pytest

from analysis.digitizing.geometry import suggesting
from analysis.digitizing.geometry.suggesting import PathMarks, suggest
from bench.analysis.simulated import true_cameras
from rig.arrays import Floats

RATE_HZ = 30.0
NAMES = ("K1", "K2", "K3")
PULSES = list(range(100, 115))


def _places(n: int = len(PULSES)) -> Floats:
    t = np.arange(n) / RATE_HZ
    return np.column_stack((1.0 + 26 * t, 0 * t, -1.0 - 5 * t**2))


def _known(*measured: tuple[int, str], closed: tuple[tuple[int, str], ...] = ()) -> PathMarks:
    flags = np.zeros((2, len(PULSES), len(NAMES)), bool)
    for of, marks in enumerate((measured, closed)):
        for pulse, name in marks:
            flags[of, PULSES.index(pulse), NAMES.index(name)] = True
    return PathMarks(_places(), *flags)


def test_a_thing_without_marks_comes_before_one_that_is_known() -> None:
    everywhere = [(pulse, name) for pulse in PULSES for name in NAMES]
    found = suggest(true_cameras(), NAMES, PULSES, {"P1": _known(*everywhere), "P2": _known()}, RATE_HZ)
    assert found is not None
    assert found.thing == "P2"
    assert "unknown" in found.why


def test_one_ray_asks_for_a_second_one() -> None:
    found = suggest(true_cameras(), NAMES, PULSES, {"P1": _known(*((p, "K1") for p in PULSES))}, RATE_HZ)
    assert found is not None
    assert found.camera != "K1"
    assert found.after < found.before


def test_the_middle_of_a_gap_is_asked_for() -> None:
    ends = [(pulse, name) for pulse in (*PULSES[:5], *PULSES[-5:]) for name in NAMES]
    found = suggest(true_cameras(), NAMES, PULSES, {"P1": _known(*ends)}, RATE_HZ)
    assert found is not None
    assert abs(found.pulse - PULSES[len(PULSES) // 2]) <= 1
    assert found.why.startswith(f"sigma of P1 at pulse {found.pulse} falls from ")


def test_what_is_hidden_or_skipped_is_not_asked_for() -> None:
    marks = [(pulse, "K1") for pulse in PULSES]
    first = suggest(true_cameras(), NAMES, PULSES, {"P1": _known(*marks)}, RATE_HZ)
    assert first is not None
    skipped = suggest(
        true_cameras(), NAMES, PULSES, {"P1": _known(*marks)}, RATE_HZ, skip=[(first.pulse, first.camera, "P1")]
    )
    assert skipped is not None
    assert (skipped.pulse, skipped.camera) != (first.pulse, first.camera)
    closed = tuple((pulse, name) for pulse in PULSES for name in ("K2", "K3"))
    assert suggest(true_cameras(), NAMES, PULSES, {"P1": _known(*marks, closed=closed)}, RATE_HZ) is None


def test_the_covariance_of_a_path_is_that_of_a_whole_adjustment() -> None:
    """A dense adjustment of all pulses with the same prior gives the same sigma before and after the mark."""
    known = _known(*((pulse, name) for pulse in PULSES[::4] for name in ("K1", "K3")))
    rows, _ = suggesting._derivatives(true_cameras(), NAMES, known.places)
    steps = np.ones(len(PULSES) - 1)
    (sparse,) = suggesting._paths(known.measured[None], rows[None], steps, RATE_HZ, 0.3)
    n, h = len(PULSES), 1 / RATE_HZ
    whole = np.zeros((9 * n, 9 * n))
    scale = np.repeat((10.0, 30.0 * h, 20.0 * h**2 / 2), 3)
    whole[:9, :9] = np.diag(scale**-2.0)
    for k in range(n):
        at = slice(9 * k, 9 * k + 3)
        whole[at, at] += np.einsum("m,mki,mkj->ij", known.measured[k] / 0.09, rows[k], rows[k])
    move, noise = suggesting._step(1.0, h)
    both = np.hstack((-move, np.eye(9)))
    for k in range(n - 1):
        at = slice(9 * k, 9 * k + 18)
        whole[at, at] += both.T @ np.linalg.inv(noise) @ both
    dense = np.linalg.inv(whole)
    for k in range(n):
        assert sparse[k] == pytest.approx(dense[9 * k : 9 * k + 3, 9 * k : 9 * k + 3], rel=1e-4, abs=1e-9)


def test_sixty_pulses_and_six_things_take_little_time() -> None:
    n = 60
    rng = np.random.default_rng(1)
    measured = rng.random((n, len(NAMES))) < 0.3
    places = np.repeat(_places(20), 3, axis=0)
    things = {f"P{i}": PathMarks(places, measured, np.zeros_like(measured)) for i in range(6)}
    took = []
    for _ in range(3):
        before = time.process_time()
        suggest(true_cameras(), NAMES, list(range(n)), things, RATE_HZ)
        took.append(time.process_time() - before)
    assert min(took) < 0.2  # 50 ms on a machine that does nothing else
