"""A hand-made start is carried through the jump; what cannot be told is not kept, and a person's own marks stay."""

import math
from pathlib import Path

import numpy as np
import pytest

from analysis.digitizing.desk import Desk
from analysis.digitizing.refining.click import refined
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import MarkSource, PlaceAction, RefineOrder, TrackOrder, UndoAction
from rig.arrays import Floats
from rig.errors import BadInputError, NoFitError
from simrig.world.scenario import load_scenario
from tests.analysis.digitizing.hill import SCATTER_PX, clicks, followed, opened, placed
from tests.support.kept import kept_hill_log

START = 20
THINGS = ["P1", "P2", "P3", "P4", "right ski", "left ski"]


@pytest.mark.long
def test_a_start_by_hand_is_carried_through_thirty_pulses(desk: Desk, jump: HillLog) -> None:
    for click in clicks(desk, jump, 11, range(START, START + 1)):
        desk.session("Anna").act(click.action())
    by_hand = dict(desk.session("Anna").at(START))
    for direction in (1, -1):
        told = followed(desk, "Anna", TrackOrder(things=THINGS, pulse=START, direction=direction, most=18))
        assert set(told.stopped) == set(THINGS)
    assert desk.session("Anna").at(START) == by_hand
    points, skis = [], []
    for pulse in (p for p in desk.log.pulses if "points" in jump.truth[p]):
        view, truth = desk.view("Anna", pulse), jump.truth[pulse]
        for name, point in view.space.items():
            if point.X is not None and point.sigma is not None:
                points.append(np.abs(np.subtract(point.X, truth["points"][name]) / point.sigma).max())
        for name, line in view.lines.items():
            if line.slope is not None and pulse != START:
                true = math.degrees(math.asin(truth["skis"][name.partition(" ")[0]]["direction"][2]))
                skis.append(abs(line.slope.value - true) / line.slope.sigma)
    assert len(points) > 4 * 28
    assert max(points) < 5
    assert len(skis) > 0.8 * 2 * 30  # both skis in 30 pulses
    assert max(skis) < 5
    sources = {entered.source for key, entered in desk.session("Anna").everything() if key.pulse != START}
    assert sources == {MarkSource.TRACKED}
    for _ in range(2):
        desk.act("Anna", UndoAction(do="undo"))
    assert dict(desk.session("Anna").everything()) == by_hand


@pytest.mark.long
@pytest.mark.parametrize("seed", [1000, 1003])
def test_a_start_by_hand_is_carried_through_a_hard_day(tmp_path: Path, seed: int) -> None:
    """Cameras shake, clouds pass, it snows, and two people stand behind him."""
    scenario = load_scenario(Path("config/scenarios/hard.toml")).model_copy(update={"stamp": False, "seed": seed})
    log = placed(kept_hill_log(scenario, range(18, 66)), tmp_path)
    desk, random = opened(log), np.random.default_rng(seed)
    start, names = log.truth[START + 10], ("P1", "P2", "P3", "P4")
    for camera, places in start["images"].items():
        marks: list[tuple[str, int | None, Floats]] = [(name, None, np.array(places[name])) for name in names]
        for side, ski in start["skis"].items():
            for end, along in enumerate((-0.9, 0.9)):
                place = np.array(ski["point"]) + along * np.array(ski["direction"])
                marks.append((f"{side} ski", end, desk.programs.oriented()[camera].project(place)))
        for thing, vertex, true in marks:
            x, y = true + random.normal(0, SCATTER_PX, 2)
            where = {"pulse": START + 10, "camera": camera, "thing": thing, "vertex": vertex, "xy": (x, y)}
            desk.act("Anna", PlaceAction(do="place", sigma=(SCATTER_PX, SCATTER_PX), **where))
    marked = dict(desk.session("Anna").everything())
    for direction in (1, -1):
        order = TrackOrder(things=THINGS, pulse=START + 10, direction=direction, most=18)
        followed(desk, "Anna", order)
    errors: dict[str, list[Floats]] = {name: [] for name in names}
    for key, entered in desk.session("Anna").everything():
        true = log.truth[key.pulse]["images"][key.camera].get(key.thing)
        if key not in marked and true is not None:
            assert entered.xy is not None
            assert entered.sigma is not None
            errors[key.thing].append(np.subtract(entered.xy, true) / entered.sigma)
    desk.close()
    for name, of in errors.items():
        assert len(of) > 0.9 * 3 * 30, name  # three images, 30 pulses
        assert 0.4 < np.sqrt(np.mean(np.square(of))) < 1.5, name  # those of one start are shared by all its pulses
        assert np.abs(of).max() < 5, name


def test_what_is_not_marked_is_not_followed(desk: Desk) -> None:
    with pytest.raises(BadInputError, match="none of these things is marked there"):
        desk.programs.follow("Anna", TrackOrder(things=THINGS, pulse=START, direction=1))
    desk.act("Anna", PlaceAction(do="place", pulse=START, camera="K1", thing="right ski", xy=(10, 10)))
    told = followed(desk, "Anna", TrackOrder(things=["right ski"], pulse=START, direction=1))
    stopped = told.stopped["right ski"]
    assert str(stopped) == "pulse 20: a ski needs two points in each of two images that show it well"
    assert (stopped.code, stopped.values) == ("hand_ski_needs", {"pulse": START})


def test_marked_skis_are_measured_in_all_images_at_once(desk: Desk, jump: HillLog) -> None:
    for click in clicks(desk, jump, 12, range(START, START + 1)):
        if click.camera != "K3" or not click.thing.endswith("ski"):
            desk.act("Anna", click.action())
    told = followed(desk, "Anna", TrackOrder(things=["right ski", "left ski", "P3"], pulse=START, direction=1, most=0))
    assert {thing: str(why) for thing, why in told.stopped.items()} == dict.fromkeys(
        ("right ski", "left ski"), "it was refined"
    )
    assert told.tracked == {"right ski": [START], "left ski": [START]}
    sources = {key.camera: e.source for key, e in desk.session("Anna").at(START).items() if key.thing == "right ski"}
    assert sources["K1"] is sources["K2"] is MarkSource.REFINED
    assert sources.get("K3", MarkSource.TRACKED) is MarkSource.TRACKED  # where it was not marked
    for name, line in desk.view("Anna", START).lines.items():
        true = math.degrees(math.asin(jump.truth[START]["skis"][name.partition(" ")[0]]["direction"][2]))
        assert line.slope is not None
        assert abs(line.slope.value - true) < 4 * line.slope.sigma
    with pytest.raises(BadInputError, match="only skis are refined"):
        desk.programs.follow("Anna", TrackOrder(things=["P3"], pulse=START, direction=1, most=0))


def test_a_click_on_a_marker_is_refined_and_one_beside_everything_refused(desk: Desk, jump: HillLog) -> None:
    camera, image = desk.programs.oriented()["K2"], desk.log.frame(START, "K2")
    true = camera.project(np.array(jump.truth[START]["points"]["P1"]))
    for dx, dy in ((1.2, -0.8), (-0.9, 0.4)):
        place = refined(image, RefineOrder(pulse=START, camera="K2", x=true[0] + dx, y=true[1] + dy, kind="disc"))
        assert np.hypot(*(np.array(place.xy) - true)) < 0.5
    with pytest.raises(NoFitError, match="no disc here"):
        refined(image, RefineOrder(pulse=START, camera="K2", x=600, y=20, kind="disc"))
