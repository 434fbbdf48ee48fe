import numpy as np
import pytest

from rig.pulse import HillPulse
from simrig.world.conditions import surroundings
from simrig.world.scenario import Scenario
from simrig.world.truth import truth
from tests.simrig.images.measuring import centroid
from tests.simrig.images.scenes import RATE_HZ, SIZE, Renderer, with_keys

#: Between K1 and the first part of the flight.
TOWER = {"X": (-5.5, -12.0, -8.0), "size_m": (2.0, 2.0, 12.0), "radiance": 100.0}


@pytest.mark.parametrize("key", ["trees", "flags", "spectators"])
def test_what_moves_moves_in_part_of_the_image_alone(calm: Scenario, key: str) -> None:
    image = Renderer(with_keys(calm, surroundings={key: 8}), rate_hz=30.0)
    plain = Renderer(with_keys(calm, light={"cloud_depth": 1e-9}), rate_hz=30.0)(90)
    changed = image(90) != image(95)
    assert 20 < changed.sum() < 0.1 * changed.size
    assert (image(90) != plain).sum() > changed.sum() / 4


def test_balls_are_in_front_of_trees_and_spectators(calm: Scenario) -> None:
    crowded = with_keys(calm, surroundings={"trees": 30, "spectators": 40, "flags": 10})
    known = truth(calm, [], RATE_HZ)["ball_images"]["K1"]
    image = Renderer(crowded, rate_hz=30.0)(90)
    for spot in known.values():
        assert np.hypot(*np.subtract(centroid(image, spot, 4.5), spot)) < 0.05


def test_a_tower_hides_what_the_truth_says(calm: Scenario) -> None:
    """Where a marker is hidden, the image is the same whether or not somebody wears the marker."""
    towered = with_keys(calm, surroundings={"towers": [TOWER]})
    dark = with_keys(towered, jumper={"marker": towered.jumper.patch})
    pulses = [HillPulse(pulse) for pulse in range(30, 45)]
    light, without = Renderer(towered, rate_hz=30.0), Renderer(dark, rate_hz=30.0)
    states = truth(towered, pulses, 30.0)["pulses"]
    shares = []
    for pulse, state in zip(pulses, states, strict=True):
        share = state["visible"]["K1"]
        drawn = np.abs(light(pulse).astype(int) - without(pulse)).sum() > 40
        assert drawn == (max(share.values()) > 0.02), (pulse, share)
        shares.append(share["P2"])
        assert state["in_sight"]["K1"] == {marker: value >= 0.5 for marker, value in share.items()}
        assert min(state["visible"]["K3"].values()) == 1.0, "the tower is elsewhere for K3"
    assert min(shares) == 0.0
    assert max(shares) == 1.0


def test_a_tower_hides_balls(calm: Scenario) -> None:
    towered = with_keys(calm, surroundings={"towers": [TOWER]})
    known = truth(towered, [], RATE_HZ)
    hidden = [name for name, share in known["ball_visible"]["K1"].items() if not share]
    assert 0 < len(hidden) < 10
    assert not [name for name, share in known["ball_visible"]["K3"].items() if not share]
    image = Renderer(towered)(0)
    for name, (x, y) in known["ball_images"]["K1"].items():
        assert (image[round(y), round(x)] > 200) == (name not in hidden)


def test_balls_may_be_covered_or_gone(calm: Scenario) -> None:
    content = calm.model_dump()["balls"]
    content[0]["gone"], content[8]["covered"] = True, 0.5
    snowed = with_keys(calm, balls=content)
    known = truth(snowed, [], RATE_HZ)
    gone, covered = (calm.balls[k].name for k in (0, 8))
    plain, image = Renderer(calm)(0), Renderer(snowed)(0)
    x, y = known["ball_images"]["K1"][gone]
    assert image[round(y), round(x)] < 190 < plain[round(y), round(x)]
    assert known["balls"][gone]["gone"]
    assert known["ball_visible"]["K1"][gone] == 0.0
    x, y = known["ball_images"]["K1"][covered]
    assert known["ball_visible"]["K1"][covered] == 0.5
    assert centroid(image, (x, y - 1), 2.5)[1] < y - 0.3, "its lower half is missing"
    live = with_keys(snowed, light={"cloud_depth": 1e-9})
    assert np.abs(Renderer(live)(0).astype(int) - image).max() <= 1, "both ways of drawing agree"


def test_people_in_front_of_the_jumper_hide_markers(calm: Scenario) -> None:
    """Somebody stands on a stage between camera and flight."""
    settings = calm.cameras[0]
    pose = truth(calm, [HillPulse(45)], 30.0)["pulses"][0]["points"]["P1"]
    place = 0.8 * np.array(pose) + 0.2 * np.array(settings.X0) - (0, 0, 0.65 * 1.75)
    crowded = with_keys(calm, surroundings={"people": [{"kind": "official", "X": place.tolist(), "walk_m": 0.0}]})
    state = truth(crowded, [HillPulse(45)], 30.0)["pulses"][0]
    assert state["visible"]["K1"]["P1"] < 0.3
    assert state["visible"]["K2"]["P1"] == 1.0
    x, y = state["images"]["K1"]["P1"]
    there = Renderer(crowded, rate_hz=30.0)(45)[round(y), round(x)]
    assert int(there) < int(Renderer(calm, rate_hz=30.0)(45)[round(y), round(x)]) - 50


def test_a_second_jumper_waits_with_markers(calm: Scenario) -> None:
    waiting = with_keys(calm, surroundings={"people": [{"kind": "jumper", "X": (-4.0, 0.0, 0.8)}]})
    image, plain = Renderer(waiting, 2), Renderer(with_keys(calm, light={"cloud_depth": 1e-9}), 2)
    assert np.array_equal(image(0), image(1)), "nobody moves"
    changed = np.argwhere(image(0) != plain(0))
    there = calm.cameras[2].projection(*SIZE).pixels((-4.0, 0.0, 1.0))[::-1]
    assert len(changed) > 100
    assert np.abs(changed - there).max() < 80
    assert (image(0)[image(0) != plain(0)] > 190).sum() >= 8, "markers and skis are bright"


def test_an_official_walks_on_the_table() -> None:
    walker = surroundings.Walker(np.array((-3.0, 1.2, 0.6)), 2.0, 0.5, 0.3, 90.0)
    places = np.array([walker.feet(t) for t in np.linspace(0, 20, 200)])
    assert np.ptp(places[:, 0]) == pytest.approx(2.0, abs=0.01)
    assert (places[:, 1:] == (1.2, 0.6)).all()
    assert np.abs(np.diff(places[:, 0])).max() / 0.1005 < 1.0
