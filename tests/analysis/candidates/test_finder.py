"""Candidates in the images of a simulated hill, judged by its truth."""

import numpy as np
import pytest

from analysis.candidates.markers.known_discs import DiscShape
from rig.errors import BadInputError
from rig.pulse import PulseNumber
from tests.analysis.candidates.judge import Hill, judged, scenario

PULSES = (29, 36, 43, 50)  # table, edge, early flight, V


@pytest.fixture(scope="module")
def hill() -> Hill:
    return Hill(scenario())


def test_all_markers_are_found_with_sigmas_that_hold(hill: Hill) -> None:
    verdict = judged(hill, PULSES)
    assert verdict.found == verdict.clear >= 44
    # 90 coordinates: the mean of their squares scatters by 0.15; the noise model is rounded up a little
    assert 0.4 < verdict.squares.mean() < 1.5
    sigma = np.sqrt(np.trace(np.array(verdict.covariances), axis1=1, axis2=2) / 2)
    assert np.median(sigma) < 0.05, "a marker of contrast 200 and noise 2.5"
    assert verdict.false < 5 * verdict.images


def test_dark_markers_on_a_light_suit_are_found_as_well() -> None:
    dark = Hill(scenario(jumper={"marker": 10.0, "patch": 180.0, "suit": 150.0}))
    verdict = judged(dark, PULSES[::2])
    assert verdict.found == verdict.clear >= 20
    assert 0.3 < verdict.squares.mean() < 1.8


def test_of_a_jumper_as_dark_as_what_is_behind_him_all_markers_are_found() -> None:
    """A dark suit before a forest: skis and markers stand out, and nothing joins them."""
    dusk = {"background_scale": 0.0, "background_offset": 30.0}
    unseen = Hill(scenario(image=dusk, jumper={"suit": 30.0, "patch": 30.0, "skis": 110.0}))
    verdict = judged(unseen, PULSES)
    assert verdict.found >= 0.85 * verdict.clear > 40  # without what is about the skis: 28 of 48
    assert verdict.false < 5 * verdict.images  # flakes of snow


def test_numbers_written_into_the_images_are_no_candidates() -> None:
    stamped = Hill(scenario().model_copy(update={"stamp": True}))
    for image in stamped.find(85).images.values():
        assert len(image.spots) == 0


def test_nothing_moves_nothing_found(hill: Hill) -> None:
    for image in hill.find(85).images.values():  # between two jumps, with flakes of snow in the air
        assert len(image.spots) == 0


def test_a_predicted_place_finds_the_marker_again(hill: Hill) -> None:
    pulse = 43
    hill.find(pulse)
    state = hill.truth([pulse])[0]
    for camera, places in state["images"].items():
        truth, off = np.array([*places.values()]), np.array((0.8, -0.6))
        predicted, sure = truth + off, np.tile(np.eye(2), (len(truth), 1, 1))
        found = hill.finder.look_for_spots([PulseNumber(pulse)] * len(truth), camera, predicted, sure)
        for place, at, spots in zip(truth, predicted, found, strict=True):
            assert np.hypot(*(spots.xy - place).T).min() < 0.15
            alone = hill.finder.look_for_spots([PulseNumber(pulse)], camera, at[None], sure[:1])[0]
            assert spots.xy == pytest.approx(alone.xy, abs=1e-3)
            assert spots.covariance == pytest.approx(alone.covariance, rel=1e-2)
    place = np.array((600.0, 20.0))
    assert len(hill.finder.look_for_spots([PulseNumber(pulse)], "K1", place[None], np.eye(2)[None])[0]) == 0
    shape = DiscShape(np.array((2.5,)), 0.2, np.zeros((1, 2)), 150.0, 40.0)
    assert np.isnan(hill.finder.fit_discs([PulseNumber(pulse)], "K1", place[None], shape).xy).all()


def test_a_hard_day_hides_few_markers() -> None:
    verdict = judged(Hill(scenario("hard")), (30, 52))
    assert verdict.found >= 0.8 * verdict.clear > 12
    # some markers have a flake of snow beside them that no model knows of
    assert np.median(verdict.squares) < 1.5


def test_a_camera_without_a_frame_has_no_candidates(hill: Hill) -> None:
    found = hill.finder.find(hill.tag(43, lost=["K2"]), hill.triplet(43))
    assert set(found.images) == {"K1", "K3"}


def test_images_of_another_size_are_refused(hill: Hill) -> None:
    small = Hill(scenario(), (320, 240))
    with pytest.raises(BadInputError, match="640 x 480"):
        hill.finder.find(small.tag(43), small.triplet(43))
