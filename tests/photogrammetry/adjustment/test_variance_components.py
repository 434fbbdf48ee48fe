"""Variance components: the true sigmas are estimated, and D5 gives what the paper prints."""

from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.run import adjust
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.adjustment.variance_components import Component, estimate_by_paper, estimate_components
from photogrammetry.network.model import Network, Reweight
from rig.errors import BadInputError
from tests.photogrammetry.synthetic import hill, lab_frame, rods


def _by_name(components: tuple[Component, ...]) -> dict[str, Component]:
    return {component.group: component for component in components}


def _two_groups() -> Network:
    """Every second observation three times less accurate than its sigma says."""
    network = lab_frame(4).network
    o = network.observations
    group = np.arange(len(o.image)) % 2
    rng = np.random.default_rng(9)
    # noise of one sigma is in already; sqrt(8) more makes three
    xy = o.xy + (group[:, None] * np.sqrt(8.0) * o.sigma) * rng.normal(size=o.xy.shape)
    return replace(network, observations=replace(o, xy=xy, group=group, groups=("good", "bad")))


def test_groups_get_their_own_sigmas_back() -> None:
    components, reweighted = estimate_components(adjust_once(_two_groups()))
    found = _by_name(components)
    for name, true in (("good", 1.0), ("bad", 3.0)):
        factor, redundancy = found[name].factor, found[name].redundancy
        assert factor is not None
        # the sigma of an estimated sigma is sigma / sqrt(2 r): 2.5 % here
        assert factor == pytest.approx(true, rel=4.0 / np.sqrt(2.0 * redundancy))
        assert found[name].sigma == pytest.approx(0.18 * factor)
    assert sum(component.redundancy for component in components) == pytest.approx(reweighted.redundancy, abs=1e-6)
    assert reweighted.ratio == pytest.approx(1.0, abs=1e-6)


def test_factors_are_a_fixed_point() -> None:
    network = replace(_two_groups(), reweight=Reweight.HELMERT)
    outcome = adjust(network)
    again, _ = estimate_components(outcome.adjustment)
    for component in again:
        assert component.factor == pytest.approx(1.0, abs=1e-6)


def test_plain_iteration_arrives_at_the_same_factors() -> None:
    """The extrapolation only saves rounds: the plain iteration ends at the same factors."""
    adjustment = adjust_once(hill(3).network)
    components, _ = estimate_components(adjustment)
    current = adjustment.network
    factors = np.ones(2)
    for _ in range(30):
        a = adjust_once(current)
        numbers = a.controlled
        change = np.sqrt(
            [
                np.sum(a.equations.v**2) / numbers.image.trace(axis1=1, axis2=2).sum(),
                np.sum(a.equations.relations.v**2) / numbers.relation.sum(),
            ]
        )
        factors *= change
        o = adjustment.network.observations
        points = tuple(
            replace(p, sigma=p.sigma * factors[1]) if p.sigma is not None else p for p in adjustment.network.points
        )
        current = replace(adjustment.network, points=points, observations=replace(o, sigma=o.sigma * factors[0]))
    ours = [component.factor for component in components]
    assert ours == pytest.approx(factors.tolist(), rel=1e-5)


def test_reference_group_of_a_paper_like_network_has_neither_8_nor_38() -> None:
    components, _ = estimate_components(adjust_once(hill(1).network))
    assert _by_name(components)["control"].redundancy == pytest.approx(25.0, abs=5.0)


def test_the_papers_way_fulfils_its_equations() -> None:
    outcome = adjust(replace(hill(1).network, reweight=Reweight.PAPER))
    assert outcome.components is not None
    a, found = outcome.adjustment, _by_name(outcome.components)
    image, control = found["image"].sigma, found["control"].sigma
    assert image is not None
    assert control is not None
    e_xy = a.image_residuals()
    e_xyz = a.relation_residuals()
    r1, r2 = a.redundancy, 15 - 7
    weight = (image / control) ** 2
    assert image**2 == pytest.approx((np.sum(e_xy**2) + weight * np.sum(e_xyz**2)) / r1, rel=1e-6)  # D5a
    assert image**2 == pytest.approx(weight * np.sum(e_xyz**2) / r2, rel=1e-6)  # D5b
    assert found["control"].redundancy == r2
    assert control > 1.5 * 0.012  # 8 instead of 25: the printed rule finds the survey worse than it is


def test_the_papers_way_needs_more_than_seven_reference_points() -> None:
    with pytest.raises(BadInputError, match=r'more than 7 control points, the network has 0.*"reweight": true'):
        estimate_by_paper(adjust_once(rods(1).network))


def test_a_group_that_nothing_controls_is_left_alone() -> None:
    components, _ = estimate_components(adjust_once(rods(1).network))
    found = _by_name(components)
    assert found["distance"].factor is None
    assert found["distance"].sigma is None
    assert found["image"].factor == pytest.approx(0.92, abs=0.1)


def test_reweighting_leaves_the_given_sigmas_out_of_the_result() -> None:
    """With sigmas ten times too small the reweighted result is the same."""
    network = replace(hill(2).network, reweight=Reweight.HELMERT)
    o = network.observations
    small = replace(network, observations=replace(o, sigma=o.sigma / 10.0))
    one, other = adjust(network).adjustment, adjust(small).adjustment
    assert np.abs(one.state.xyz - other.state.xyz).max() < 1e-6
    columns = one.problem.unknowns.point
    assert one.sigmas(columns) == pytest.approx(other.sigmas(columns), rel=1e-5)
