"""A survey that contradicts the images: culprits are isolated and named, or the result is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from bench.photogrammetry.hills import (
    Hill,
    Spoil,
    exchanged_cameras,
    exchanged_names,
    few_rays,
    hill,
    mirrored,
    other_station,
    other_unit,
    with_poses,
    wrong_survey,
)
from photogrammetry.network.diagnosis import RefusedError
from photogrammetry.network.file_writer import write_network
from photogrammetry.procedures.orientation import Orientation, orient
from photogrammetry.procedures.stages import snoop_network
from svev.cli import main
from tests.support.repeats import repeats


def _spoilt(spoil: Spoil, seed: int, *, poses: bool = False) -> Hill:
    rng = np.random.default_rng(seed)
    case = hill(rng, helmets=False)
    return spoil(with_poses(case, rng) if poses else case, rng)


def _removed(orientation: Orientation) -> set[str]:
    gone = orientation.outcome.removed
    return {one.network.points[one.blunder.suspect.index].name for one in gone}


def _off(case: Hill, orientation: Orientation) -> float:
    """Largest error of a projection centre in sigmas."""
    a = orientation.outcome.adjustment
    sigma = a.sigmas(a.problem.unknowns.pose[:, :3])
    return float(np.abs((a.state.position - case.positions) / sigma).max())


@pytest.mark.parametrize("pairs", [1, 2])
@pytest.mark.parametrize("seed", repeats(range(3)))
def test_exchanged_names_are_told_and_only_they_are_taken_out(pairs: int, seed: int) -> None:
    case = _spoilt(exchanged_names(pairs), seed)
    orientation = orient(case.network)
    assert _removed(orientation) == set(case.culprits)
    assert _off(case, orientation) < 4.5
    told = [finding.message for stage in orientation.stages for finding in stage.findings]
    for one, other in zip(case.culprits[::2], case.culprits[1::2], strict=True):
        assert any(one in words and other in words and "look exchanged" in words for words in told)


def test_three_exchanges_are_more_than_a_survey_may_lose() -> None:
    case = _spoilt(exchanged_names(3), 0)
    with pytest.raises(RefusedError) as refused:
        orient(case.network)
    words = str(refused.value)
    assert "reference points would have to go" in words
    assert all(name in words for name in case.culprits)
    assert words.count("look exchanged") == 3


@pytest.mark.parametrize("spoil", [wrong_survey(3), other_station(4), other_unit(1000.0, 3)])
def test_several_wrong_points_are_taken_out_together(spoil: Spoil) -> None:
    case = _spoilt(spoil, 5)
    orientation = orient(case.network)
    assert _removed(orientation) == set(case.culprits)
    assert _off(case, orientation) < 4.5


@pytest.mark.parametrize(
    ("spoil", "poses", "words"),
    [
        (mirrored, False, "the survey is mirrored"),
        (other_station(8), False, "reference points would have to go|the survey contradicts the images"),
        (other_unit(1 / 0.3048), True, "times as far apart as their given poses"),
        (other_unit(1000.0), True, "times as far apart as their given poses"),
        (exchanged_cameras, True, "exchanged"),
    ],
)
def test_a_survey_that_contradicts_the_images_is_refused(spoil: Spoil, poses: bool, words: str) -> None:
    case = _spoilt(spoil, 6, poses=poses)
    with pytest.raises(RefusedError, match=words):
        orient(case.network)


@pytest.mark.parametrize("seed", repeats([1, 2, 3, *range(4, 40)], quick=3))
def test_one_wrong_image_point_among_few_rays_leads_to_no_other_block(seed: int) -> None:
    """The images alone form a block metres away, or look exchanged; the survey knows better."""
    case = _spoilt(few_rays, seed)
    assert _off(case, orient(case.network)) < 6.0


def test_a_point_that_cannot_be_judged_does_not_bend_the_result() -> None:
    """Of the third wrong point either the survey or one image point is wrong: both are named, neither is used."""
    rng = np.random.default_rng([46, 7])
    case = wrong_survey(3)(hill(rng), rng)
    orientation = orient(case.network)
    assert _removed(orientation) == set(case.culprits) - {"B8"}
    (aside,) = orientation.outcome.aside
    assert not aside.blunder.locatable
    assert _off(case, orientation) < 4.5
    words = orientation.stages[2].findings[0].message
    assert "control point B8; point B8 in image hill-1" in words
    assert words.endswith("the result does not use them")


def test_snooping_of_a_whole_network_isolates_exchanged_names_too() -> None:
    case = _spoilt(exchanged_names(2), 7)
    outcome = snoop_network(case.network)
    gone = {one.network.points[one.blunder.suspect.index].name for one in outcome.removed}
    assert gone == set(case.culprits)
    assert outcome.adjustment.ratio < 1.5


def test_a_refusal_is_exit_4_and_leaves_no_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    network, result = tmp_path / "hill.json", tmp_path / "poses.json"
    write_network(_spoilt(mirrored, 8).network, network)
    assert main(["orient", str(network), "--force", "-o", str(result)]) == 4
    assert capsys.readouterr().out.startswith("refused: the survey is mirrored")
    content = json.loads(result.read_text())
    assert content["converged"] is False
    assert "images" not in content
