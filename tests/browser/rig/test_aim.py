"""The view that sets up a camera: its bar holds the best sharpness, and its figures are those of the camera chosen."""

import re
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Page, expect

from rig.api.cameras.balls import BallPlace, BallSource, CameraBalls
from rig.api.recordings import RecordingOrder
from rig.api.statement import Statement
from rig.frame import FrameStatus
from rig.pulse import HillPulse
from service.aiming.balls import BallPlaces
from simrig.images.view import CameraView
from tests.analysis.scene.hill import SIZE, balls_in, training
from tests.browser.conftest import Open
from tests.browser.views import BROKEN, assert_fits_a_phone
from tests.service.cameras.test_balls import survey_file, surveyed, true_pose
from tests.support.repeats import repeats
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import COLUMNS, SHAPE, MemoryService, write_recording
from tests.webpanel.serving import Panel, refused

_MAGENTA = np.array([255, 0, 255])
_LEFT, _RIGHT = 60, 100
#: Columns around the edges of the bar that may be painted; a JPEG of colours spreads what is painted.
_AROUND = 12


def lens(spread_px: float, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A black bar before white snow, through a lens that spreads points by so much."""
    scene = np.full(image.shape, 255, np.uint8)
    scene[:, _LEFT:_RIGHT] = 40
    return np.asarray(cv2.GaussianBlur(scene, (0, 0), spread_px), np.uint8)


def share(page: Page) -> int:
    """What the bar says, percent of the best."""
    return int(page.locator("#aim-bar").get_attribute("aria-valuenow") or 0)


def test_the_bar_falls_behind_its_best_when_the_lens_is_turned_too_far(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    page = open_page(f"{panel.url}/#/aim", width=360, height=780, color_scheme="dark")
    expect(page.locator("#aim-empty")).to_have_text("Arm the rig: then the pictures come.")
    service.through_the_lens = lambda image: lens(3.0, image)
    service.arm()
    wait_until(lambda: share(page) == 100, "the first picture is the best so far", poll_s=0.05)
    first = page.locator("#aim-value").inner_text()
    service.through_the_lens = lambda image: lens(0.5, image)
    wait_until(lambda: page.locator("#aim-value").inner_text() > first, "it is sharper", poll_s=0.05)
    service.through_the_lens = lambda image: lens(3.0, image)
    wait_until(lambda: 40 < share(page) < 70, "it is behind its best", poll_s=0.05)
    expect(page.locator("#aim-focus")).to_have_attribute("data-level", "warning")
    page.locator("#aim-cameras button").nth(1).click()
    wait_until(lambda: share(page) == 100, "another camera has its own best", poll_s=0.05)
    page.locator("#aim-cameras button").nth(0).click()
    wait_until(lambda: 40 < share(page) < 70, "this one has kept its", poll_s=0.05)
    page.locator("#aim-again").click()
    wait_until(lambda: share(page) == 100, "it is forgotten", poll_s=0.05)
    expect(page.locator("#aim-figures [data-level=warning] dd")).to_contain_text("%")  # the snow is clipped
    expect(page.locator("#aim-image")).to_have_js_property("naturalWidth", COLUMNS[0][1])
    assert_fits_a_phone(page)


def test_an_earlier_picture_of_the_camera_lies_over_the_live_one(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    write_recording(service.catalogue.directory, "yesterday", ((FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK),) * 3)
    service.arm()
    page = open_page(f"{panel.url}/#/aim", width=360, height=780)
    ghost = page.locator("#aim-ghost")
    expect(page.locator("#aim-image")).not_to_have_js_property("naturalWidth", 0)
    expect(ghost).to_be_hidden()
    page.locator("#aim-earlier").select_option("yesterday")
    expect(ghost).to_have_attribute("src", "./api/recordings/yesterday/pulses/1.jpg?camera=K1")
    expect(ghost).to_have_js_property("naturalWidth", COLUMNS[0][1])
    expect(ghost).to_be_visible()
    page.locator("#aim-mix").fill("80")
    expect(ghost).to_have_css("opacity", "0.8")
    live, over = page.locator("#aim-image").bounding_box(), ghost.bounding_box()
    assert live == over
    page.locator("#aim-cameras button").nth(1).click()
    expect(page.locator("#aim-earlier-not")).to_have_text("K2 has no picture in that recording.")
    expect(ghost).to_be_hidden()
    page.locator("#aim-cameras button").nth(2).click()
    expect(ghost).to_have_attribute("src", re.compile("camera=K3$"))
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    assert page.evaluate(BROKEN) == []
    page.locator("#aim-earlier").select_option("")
    expect(ghost).to_be_hidden()


def test_pictures_are_whole_and_painted_where_they_are_in_focus(client: httpx.Client, service: MemoryService) -> None:
    service.through_the_lens = lambda image: lens(0.5, image)
    service.arm()
    plain = _picture(client.get("/api/cameras/K3/picture.jpg"))
    assert plain.shape[:2] == (SHAPE[0], COLUMNS[2][1] - COLUMNS[2][0])
    painted = _picture(client.get("/api/cameras/K3/picture.jpg", params={"peaking": True}))
    marked = np.flatnonzero((np.abs(painted - _MAGENTA).sum(axis=2) < 100).any(axis=0))
    distance = np.minimum(np.abs(marked - _LEFT), np.abs(marked - _RIGHT))
    assert (marked.size > 0, distance.max() < _AROUND) == (True, True)
    aids = client.get("/api/cameras/K3/aids").json()
    assert (aids["status"], sum(aids["histogram"])) == ("ok", plain.shape[0] * plain.shape[1])
    assert refused(client.get("/api/cameras/K9/aids"), 404).code == "unknown_camera"
    service.disarm()
    assert client.get("/api/cameras/K3/aids").status_code == 204


def _picture(answer: httpx.Response) -> NDArray[np.int64]:
    assert answer.status_code == 200, answer.text
    image = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(image, np.int64)


def test_a_camera_is_made_brighter_and_kept_so(panel: Panel, service: MemoryService, open_page: Open) -> None:
    service.arm()
    page = open_page(f"{panel.url}/#/aim", width=360, height=780, color_scheme="light")
    exposure, gain, said = (page.locator(name) for name in ("#light-exposure", "#light-gain", "#light-said"))
    expect(exposure).to_have_text("2.00 ms")
    expect(page.locator("#light-less")).to_be_disabled()
    expect(page.locator("#light-save")).to_be_disabled()
    page.locator("#light-longer").click()
    expect(exposure).to_have_text("2.52 ms")
    page.locator("#light-more").click()
    expect(gain).to_have_text("1.0 dB")
    expect(said).to_contain_text("keep it")
    page.locator("#aim-cameras button").nth(1).click()
    expect(exposure).to_have_text("2.00 ms")
    page.locator("#aim-cameras button").nth(0).click()
    expect(exposure).to_have_text("2.52 ms")
    page.locator("#light-save").click()
    expect(said).to_have_text("The rig file says the same.")
    assert service.lights["K1"].saved
    assert service.lights["K2"].exposure_us == 2000
    service.start_recording(RecordingOrder())
    expect(page.locator("#light-shorter")).to_be_disabled()
    expect(said).to_have_text("Not while a recording runs.")
    assert_fits_a_phone(page)


def show_hill(service: MemoryService, folder: Path) -> NDArray[np.uint8]:
    """The simulated hill before the first camera, and a survey with the true poses of the cameras.

    Returns:
        The picture.
    """
    rig = surveyed(survey_file(folder / "hill.json", training(), true_pose))
    service.balls = BallPlaces(lambda: rig, folder).of
    picture = np.empty(SIZE[::-1], np.uint8)
    CameraView(training(), 0, *SIZE, 30.0).render_into(picture, HillPulse(1))
    service.through_the_lens = lambda _: picture
    service.arm()
    return picture


def circles(page: Page) -> dict[str, NDArray[np.float64]]:
    """Where the centres of the circles lie in the camera's picture, px."""
    image = page.locator("#aim-image").bounding_box()
    assert image is not None
    found = {}
    for ring in page.locator("#balls i").all():
        box = ring.bounding_box()
        assert box is not None
        middle = np.array((box["x"] + box["width"] / 2 - image["x"], box["y"] + box["height"] / 2 - image["y"]))
        found[ring.get_attribute("data-ball") or ""] = middle * SIZE[0] / image["width"] - 0.5
    return found


@pytest.mark.parametrize(("width", "look"), repeats([(360, "dark"), (1280, "light")]))
def test_circles_lie_on_the_balls_of_the_simulated_hill(
    panel: Panel, service: MemoryService, open_page: Open, tmp_path: Path, width: int, look: str
) -> None:
    picture = show_hill(service, tmp_path)
    page = open_page(f"{panel.url}/#/aim", width=width, height=800, color_scheme=look)
    true = balls_in(training(), "K1")
    expect(page.locator("#balls i")).to_have_count(len(true))
    expect(page.locator("#aim-image")).to_have_js_property("naturalWidth", SIZE[0])
    for name, place in circles(page).items():
        assert np.abs(place - true[name]).max() < 0.5, name
        x, y = np.rint(place).astype(int)
        around = picture[y - 12 : y + 13, x - 12 : x + 13]
        assert picture[y - 1 : y + 2, x - 1 : x + 2].mean() > np.percentile(around, 90), "a bright ball is there"
    names = page.locator("#balls b").all_inner_texts()
    assert len(names) > 0.9 * len(true)
    expect(page.locator("#balls-said")).to_have_text("21 of 21 balls are in the picture.")
    expect(page.locator("#balls-by")).to_contain_text("By the rough pose in hill.json")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.evaluate(BROKEN) == []
    page.locator("#balls-on").uncheck()
    expect(page.locator("#balls")).to_be_hidden()
    page.reload()
    expect(page.locator("#aim-image")).to_have_js_property("naturalWidth", SIZE[0])
    expect(page.locator("#balls-on")).not_to_be_checked()
    expect(page.locator("#balls")).to_be_hidden()
    page.locator("#balls-on").check()
    expect(page.locator("#balls i")).to_have_count(len(true))


def test_balls_beyond_the_picture_are_told_with_an_arrow(panel: Panel, service: MemoryService, open_page: Open) -> None:
    shown = CameraBalls(camera="K1", width=160, height=120, source=BallSource.CALIBRATION, file="poses.json", balls=(
        BallPlace(name="B1", x=80.0, y=60.0, sigma=(0.1, 0.2), inside=True, seen=True),
        BallPlace(name="B2", x=20.0, y=90.0, sigma=(0.1, 0.2), inside=True, seen=False),
        BallPlace(name="B7", x=-40.5, y=60.0, inside=False, seen=True),
        BallPlace(name="B8", x=180.0, y=130.0, inside=False, seen=True),
        BallPlace(name="B9", x=None, y=None, inside=False),
        BallPlace(name="T1", x=-3.0, y=20.0, inside=False, seen=False),
    ))  # fmt: skip
    unknown = Statement(
        code="balls_not_oriented", text="K2 is not oriented", advice="record the balls", values={"camera": "K2"}
    )
    nothing = CameraBalls(camera="K2", width=160, height=120, statement=unknown)
    service.balls = lambda name: shown if name == "K1" else nothing
    service.arm()
    page = open_page(f"{panel.url}/#/aim", width=360, height=780)
    expect(page.locator("#balls-said")).to_have_text(
        "2 of 6 balls are in the picture. B7: 40 px beyond the left edge; B8: 21 px beyond the right edge, 11 px "
        "beyond the lower edge; B9: behind the camera."
    )
    expect(page.locator("#balls-by")).to_have_text("By the poses in poses.json.")
    for ring in page.locator("#balls i").all():  # also that of a ball which was hidden when the camera was oriented
        expect(ring).to_have_css("width", "20px")
    expect(page.locator("#balls-said")).to_have_attribute("data-level", "warning")
    expect(page.locator("#balls s")).to_have_count(3)
    box, arrow = page.locator("#balls").bounding_box(), page.locator("#balls s").first.bounding_box()
    assert box is not None
    assert arrow is not None
    assert box["x"] <= arrow["x"] < box["x"] + 10
    page.locator("#aim-cameras button").nth(1).click()
    expect(page.locator("#balls")).to_be_hidden()
    expect(page.locator("#balls-said")).to_have_text("K2 is not oriented.")
    expect(page.locator("#balls-by")).to_have_text("Record the balls.")
    norwegian = open_page(f"{panel.url}/#/aim", width=360, height=780, locale="nb-NO")
    expect(norwegian.locator("#balls-said")).to_contain_text("B7: 40 px utenfor venstre kant")
    norwegian.locator("#aim-cameras button").nth(1).click()
    expect(norwegian.locator("#balls-said")).to_contain_text("K2 er ikke orientert ennå")
