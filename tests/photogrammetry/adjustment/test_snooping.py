"""Search for gross errors in difficult cases: shifted optima, no optimum, observations that cannot be told apart."""

from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.gross_errors.blunders import BlunderKind, Observation, observation_to_json, without
from photogrammetry.adjustment.gross_errors.robust import linearised_at, robust_state
from photogrammetry.adjustment.gross_errors.suspicion import find_blunders
from photogrammetry.adjustment.run import adjust
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.network.model import Network, Role
from photogrammetry.procedures.orientation import orient
from photogrammetry.start_values.search import complete
from tests.photogrammetry.synthetic import hill, rods


def _without_start(network: Network) -> Network:
    return replace(
        network,
        images=tuple(replace(image, position=None, rotation=None) for image in network.images),
        points=tuple(replace(p, xyz=None) if p.role is Role.TIE else p for p in network.points),
    )


def _spoilt(network: Network, row: int, error: tuple[float, float]) -> Network:
    xy = network.observations.xy.copy()
    xy[row] += error
    return replace(network, observations=replace(network.observations, xy=xy))


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "row", "error"),
    [
        (29, 7, (237.5, -183.3)),  # the end of a rod, so that the block is turned wrongly to begin with
        (65, 4, (293.5, -62.2)),
        (66, 56, (299.8, 11.9)),
        (77, 2, (-256.9, -155.0)),  # a distance was accused instead,
        (91, 1, (-269.7, -131.4)),  # and here
        (111, 52, (270.9, -128.8)),
    ],
)
def test_300_px_in_a_weak_network_without_start_values(seed: int, row: int, error: tuple[float, float]) -> None:
    network = _without_start(_spoilt(rods(seed).network, row, error))
    outcome = adjust(network, state_of(complete(network)), snoop=True)
    assert [removed.blunder.suspect for removed in outcome.removed] == [Observation(BlunderKind.IMAGE, row)]
    assert outcome.blunders == ()
    # in a free adjustment without it the point is known to some pixels
    assert np.abs(outcome.removed[0].blunder.estimate - error).max() < 15.0


@pytest.mark.long
@pytest.mark.parametrize(("seed", "index", "error"), [(13, 1, 1.6), (30, 7, -2.8), (15, 8, 3.1)])
def test_a_rod_that_leans_by_metres_is_named(seed: int, index: int, error: float) -> None:
    """Verticality 80 to 160 sigma off: a network with redundancy 15 is deformed by it, or has no optimum."""
    network = rods(seed).network
    differences = list(network.differences)
    differences[index] = replace(differences[index], value=differences[index].value + error)
    network = _without_start(replace(network, differences=tuple(differences)))
    outcome = adjust(network, state_of(complete(network)), snoop=True)
    assert [removed.blunder.suspect for removed in outcome.removed] == [Observation(BlunderKind.DIFFERENCE, index)]
    assert outcome.removed[0].blunder.estimate[0] == pytest.approx(error, abs=0.3)


@pytest.mark.parametrize(
    ("seed", "helmets", "row", "error"),
    [
        (59, 17, 49, (-5.3, 3.1)),  # its neighbour's ray was accused, then the point's survey
        (119, 17, 39, (1.3, -1.1)),  # its survey
        (287, 17, 1, (4.9, -0.1)),  # its survey, in the last stage
        (116, 0, 45, (-18.1, 9.8)),  # its survey, because the block was bent
    ],
)
def test_an_image_error_accuses_nothing_else(seed: int, helmets: int, row: int, error: tuple[float, float]) -> None:
    """The right observation is named, alone or among candidates, or the error is too small to be detected."""
    network = hill(seed, helmets=helmets).network
    o = network.observations
    names = (network.images[o.image[row]].name, network.points[o.point[row]].name)
    orientation = orient(_without_start(_spoilt(network, row, error)))
    for removed in orientation.outcome.removed:
        found = observation_to_json(removed.network, removed.blunder.suspect)
        assert (found["image"], found["point"]) == names
    for blunder in orientation.outcome.blunders:
        candidates = [observation_to_json(orientation.outcome.adjustment.network, c) for c in blunder.candidates]
        assert names in [(c["image"], c["point"]) for c in candidates]


def test_the_robust_view_is_that_of_the_sound_observations() -> None:
    network, row = _spoilt(rods(3).network, 40, (-200.0, 220.0)), 40
    state = robust_state(network, state_of(network))
    sound = adjust_once(without(network, Observation(BlunderKind.IMAGE, row)), state_of(network))
    sigma = sound.sigmas(sound.problem.unknowns.pose[:, :3])
    assert np.abs((state.position - sound.state.position) / sigma).max() < 1.0
    suspects = find_blunders(linearised_at(network, state))
    assert Observation(BlunderKind.IMAGE, row) in (suspects[0].suspect, *suspects[0].candidates)


def test_linear_tests_at_the_optimum_are_those_of_the_adjustment() -> None:
    network = hill(2).network
    adjusted = adjust_once(network)
    linear = linearised_at(network, adjusted.state)
    assert linear.equations.v == pytest.approx(adjusted.equations.v, abs=1e-4)
    assert linear.image_w() == pytest.approx(adjusted.image_w(), abs=1e-3)


def test_two_errors_that_cover_each_other_do_not_accuse_a_third() -> None:
    """Errors in both rays of one point and a wrong survey elsewhere: only these are named."""
    network = hill(5, helmets=17).network
    o = network.observations
    rows = [int(np.flatnonzero((o.image == image) & (o.point == point))[0]) for image, point in ((0, 2), (2, 11))]
    spoilt = _spoilt(_spoilt(network, rows[0], (14.0, 20.0)), rows[1], (-25.0, 12.0))
    points = list(spoilt.points)
    points[8] = replace(points[8], xyz=np.asarray(points[8].xyz) + np.array([0.3, -0.4, 0.2]))
    removed = adjust(replace(spoilt, points=tuple(points)), snoop=True).removed
    found = {tuple(observation_to_json(gone.network, gone.blunder.suspect).values()) for gone in removed}
    names = {("image", network.images[o.image[r]].name, network.points[o.point[r]].name) for r in rows}
    assert found == {*names, ("control", None, "B9")}
