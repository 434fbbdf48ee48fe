"""Units and far-away origins change nothing but the units."""

from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import Network
from rig.arrays import Floats
from tests.photogrammetry.synthetic import lab_frame

#: What a change of the image unit does to each parameter.
_POWER = dict(zip(INTERIOR, (1, 1, 1, -2, -4, -6, -1, -1, 0, 0), strict=True))


def _in_units(network: Network, pixel: float, metre: float, origin: Floats) -> Network:
    factors = np.array([pixel ** _POWER[name] for name in INTERIOR])
    o = network.observations
    return replace(
        network,
        cameras=tuple(replace(c, interior=c.interior * factors) for c in network.cameras),
        observations=replace(o, xy=o.xy * pixel, sigma=o.sigma * pixel),
        images=tuple(
            replace(i, position=i.position * metre + origin) for i in network.images if i.position is not None
        ),
        points=tuple(replace(p, xyz=p.xyz * metre + origin) for p in network.points if p.xyz is not None),
    )


@pytest.mark.parametrize(
    ("pixel", "metre", "origin", "tolerance"),
    [
        (0.0032, 1.0, (0.0, 0.0, 0.0), 1e-6),  # millimetres in the image
        (1.0, 1000.0, (0.0, 0.0, 0.0), 1e-6),  # millimetres in the object
        # a national grid: the last bit of a northing is 1e-9 m, 1e-5 of a point's sigma
        (1.0, 1.0, (5.7e5, 7.03e6, 200.0), 1e-3),
    ],
)
def test_only_the_units_change(pixel: float, metre: float, origin: tuple[float, ...], tolerance: float) -> None:
    network = lab_frame(5, points=20).network
    one = adjust_once(network)
    other = adjust_once(_in_units(network, pixel, metre, np.array(origin)))
    assert other.free.defect == 7
    assert other.ratio == pytest.approx(one.ratio, rel=1e-8)
    columns = one.problem.unknowns.point
    assert other.sigmas(columns) / metre == pytest.approx(one.sigmas(columns), rel=tolerance)
    assert np.abs(other.image_w() - one.image_w()).max() < tolerance
    assert np.abs(other.controlled.image - one.controlled.image).max() < tolerance
    off = (other.state.xyz - np.array(origin)) / metre - one.state.xyz
    assert np.abs(off / one.sigmas(columns)).max() < tolerance
