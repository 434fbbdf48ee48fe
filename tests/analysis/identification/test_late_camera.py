"""A camera that shows the jumper late does not give markers the places of others, in a scene of the corpus."""

from pathlib import Path

import pytest

from bench.corpus.draws import Half, draw
from bench.corpus.judging import judge


@pytest.mark.long
def test_chance_names_do_not_hide_that_a_camera_is_late(tmp_path: Path) -> None:
    """Two cameras beside each other, one of them 12 ms late: its rays meet others of the third camera by chance."""
    row = judge(draw(Half.WORK, 450), tmp_path)
    assert row.controlled > 100
    assert row.beyond == 0
    assert row.solved > 0.8 * row.points
