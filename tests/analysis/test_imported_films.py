"""Films of a jump, made into a log again: measured as well as the log that they are of, and a wrong start is named."""

import json
from pathlib import Path

import numpy as np
import pytest

from recorder.reading.triplets import triplets
from svev.cli import main
from tests.analysis.simulated import training
from tests.support.kept import kept_hill_log

#: The jumper is in sight from hill pulse 23 to 60.
PULSES = range(14, 70)


@pytest.mark.long
def test_films_are_measured_and_a_wrong_start_is_named(tmp_path: Path) -> None:
    jump = kept_hill_log(training(), PULSES)
    assert main(["export", str(jump.path), "--out", str(tmp_path / "film.mkv"), "--separate"]) == 0
    films = [f"{name}={tmp_path}/film_{name}.mkv" for name in ("K1", "K2", "K3")]
    verdicts = []
    for name, start in (("right", []), ("wrong", ["--start", "K2=2"])):
        log = tmp_path / f"{name}.mcap"
        assert main(["import", *films, "-o", str(log), "--rate", "30", *start]) == 0
        out = tmp_path / name
        assert main(["analyze", str(log), "--survey", str(jump.survey), "--out", str(out)]) == 0
        verdicts.append(json.loads((out / "jumper.json").read_text())["jumps"][0]["verdict"])
    assert all(
        np.array_equal(one, two)
        for (_, one), (_, two) in zip(triplets(jump.path), triplets(tmp_path / "right.mcap"), strict=True)
    )
    assert verdicts[0]["ok"], verdicts[0]["message"]
    assert not verdicts[1]["ok"]
    assert "camera K2 shows the jumper 33.3 ms (1.00 frames) later than the others" in verdicts[1]["message"]
