"""Whether an adjusted network's values may be used at all."""

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import TOLERABLE, GlobalTest, Verdict


def is_unusable(a: Adjustment) -> bool:
    """Whether the global test is absurd, and the residuals exceed what a result may have (decision 0036).

    Very small sigmas alone make no result unusable.
    """
    return GlobalTest(a.ratio, a.redundancy).verdict is Verdict.ABSURD and _is_gross(a)


def _is_gross(a: Adjustment) -> bool:
    """Whether residuals of images or survey (rms of the coordinates) exceed what a result may have."""
    network, columns = a.network, a.problem.image
    c = np.array([a.state.interior[image.camera, 0] for image in network.images])
    angles = a.image_residuals() / c[columns][:, None]
    survey = a.relation_residuals()[a.problem.relations.rows(Kind.CONTROL)]
    extent = float(np.ptp(a.state.xyz, axis=0).max(initial=0.0))
    return bool(
        (len(angles) and not np.sqrt(np.mean(angles**2)) <= TOLERABLE)
        or (len(survey) and not np.sqrt(np.mean(survey**2)) <= TOLERABLE * extent)
    )
