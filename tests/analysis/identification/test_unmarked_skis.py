"""Skis are found and told by helmet and hip where the bindings wear no markers."""

import numpy as np
import pytest

from analysis.cameras.source import read_source
from analysis.procedure.analyze import analyze
from analysis.result.model import Status
from photogrammetry.jumper.stick_model import slope_and_heading
from simrig.world.conditions.effects import MissingMarker
from tests.analysis.simulated import training
from tests.support.kept import kept_hill_log


@pytest.mark.long
def test_skis_are_measured_where_the_bindings_wear_no_markers() -> None:
    jumper = training().jumper.model_copy(
        update={"missing_markers": tuple(MissingMarker(marker=name) for name in ("P3", "P4"))}
    )
    log = kept_hill_log(training().model_copy(update={"jumper": jumper}), range(30, 66))
    (jump,) = analyze(log.path, read_source(log.survey, None)).result.jumps
    assert not [p.pulse for p in jump.pulses for name in ("P3", "P4") if p.raw.points[name] is not None]
    deviations = []
    for pulse in jump.pulses:
        for side, ski in pulse.raw.skis.items():
            if ski is not None:
                true = log.truth[pulse.pulse]["skis"][side]["direction"]
                off = np.radians((ski.slope.value, ski.heading.value)) - slope_and_heading(np.array(true))
                deviations.append(float(off @ np.linalg.solve(ski.covariance, off)))
                assert ski.status is not Status.PREDICTED
    assert len(deviations) > 30
    assert np.quantile(deviations, 0.9) < 12.0, "chi-squared of two, one survey for all"
