"""The page of measuring by hand on a rendered jump, and what is kept."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from analysis.measurements.model import POINTS
from bench.analysis.hill_logs import HillLog
from rig.arrays import Floats
from simrig.world.conditions.effects import MissingMarker
from tests.analysis.digitizing.hill import adopt, orientation_of
from tests.analysis.simulated import SIZE, training
from tests.browser.conftest import Open
from tests.support.kept import kept_hill_log
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel

#: The pulse of the log that the tests measure in: the jumper is in sight of all cameras.
PULSE = 10
OPERATOR = "Anna"


@dataclass(frozen=True, slots=True)
class Desk:
    """A page of measuring by hand.

    Attributes:
        url: its address.
        log: what is measured.
        client: asks the server what is kept.
        log_in_panel: its copy among the recordings of the panel.
    """

    url: str
    log: HillLog
    client: httpx.Client
    log_in_panel: Path

    def view(self, pulse: int = PULSE, operator: str = OPERATOR) -> dict[str, Any]:
        """What is kept of a pulse."""
        return self._get(f"/sessions/{operator}/pulses/{pulse}")

    def session(self, operator: str = OPERATOR) -> dict[str, Any]:
        """What is kept of all."""
        return self._get(f"/sessions/{operator}")

    def wait_for(self, revision: int) -> None:
        """Wait until so many acts are kept."""
        wait_until(lambda: self.session()["revision"] == revision, f"{revision} acts are kept")

    def _get(self, path: str) -> dict[str, Any]:
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        found: dict[str, Any] = answer.json()
        return found

    def mark(self, camera: str, thing: str, pulse: int = PULSE) -> dict[str, Any] | None:
        """What is kept of a thing in an image."""
        found: dict[str, Any] | None = self.view(pulse)["marks"].get(camera, {}).get(thing)
        return found

    def true(self, camera: str, thing: str, pulse: int = PULSE) -> Floats:
        """Where a point of the jumper really is in an image, px."""
        return self.image(camera, np.array(self.log.truth[pulse]["points"][thing]))

    def image(self, camera: str, point: Floats) -> Floats:
        """Where a point in space is in an image, px."""
        scenario = training()
        projection = scenario.cameras[scenario.camera_index(camera)].projection(*SIZE)
        return np.asarray(projection.pixels(point))

    def place(self, camera: str, thing: str, place: Floats) -> None:
        """Mark a thing in an image, as another page would."""
        action = {"do": "place", "pulse": PULSE, "camera": camera, "thing": thing, "xy": place.tolist()}
        answer = self.client.post(f"/sessions/{OPERATOR}/actions", json=action)
        assert answer.status_code == 200, answer.text


@pytest.fixture
def markers() -> bool:
    """Whether the jumper wears markers."""
    return True


@pytest.fixture
def rendered(markers: bool) -> HillLog:
    """Twenty pulses of the rendered hill, to be copied."""
    bare = () if markers else tuple(MissingMarker(marker=name) for name in POINTS)
    jumper = training().jumper.model_copy(update={"missing_markers": bare})
    return kept_hill_log(training().model_copy(update={"jumper": jumper}), range(36, 56))


@pytest.fixture
def desk(desk_by_survey: Desk, service: MemoryService, panel: Panel) -> Desk:
    """The same, with cameras that were oriented by that survey before."""
    survey, service.survey = service.survey, None
    adopt(panel.desks.desk("jump"), orientation_of(desk_by_survey.log))
    service.survey = survey
    return desk_by_survey


@pytest.fixture
def desk_by_survey(rendered: HillLog, service: MemoryService, panel: Panel) -> Iterator[Desk]:
    """The rendered jump in the panel; when it is opened first, its cameras are oriented by the survey."""
    log = Path(shutil.copy(rendered.path, service.catalogue.directory / "jump.mcap"))
    service.survey = rendered.survey
    with panel.client() as client:
        client.base_url = f"{panel.url}/api/recordings/jump/digitizing"
        yield Desk(f"{panel.url}/digitize.html?recording=jump", rendered, client, log)


def enter(open_page: Open, desk: Desk, pulse: int = PULSE, operator: str = OPERATOR, **more: Any) -> Page:
    """Open the page as an operator, at a pulse, with its frames in sight."""
    page = open_page(desk.url, **more)
    page.locator("#operator-name").fill(operator)
    page.locator("#operator-submit").click()
    expect(page.locator("#orientation-lamp")).to_have_attribute("data-level", "good")
    page.keyboard.press("Home")
    for _ in range(pulse - 1):
        page.keyboard.press("w")
    expect(page.locator("#pulse-number")).to_have_text(str(pulse))
    settled(page)
    return page


def settled(page: Page) -> None:
    """Wait until the frames in sight are there, and drawn."""
    expect(page.locator(".pane[data-fate=o] .pane-fate:visible")).to_have_count(0)
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def canvas_of(page: Page, camera: str) -> dict[str, float]:
    """The box of a camera's picture on the page as it is painted, on whole pixels of the screen, CSS px."""
    box: Any = page.locator(f'.pane[data-camera="{camera}"] canvas').bounding_box()
    assert box is not None
    ratio = page.evaluate("devicePixelRatio")
    left, top = (float(np.floor(box[name] * ratio + 0.5)) / ratio for name in ("x", "y"))
    right, bottom = (
        float(np.floor((box[name] + box[size]) * ratio + 0.5)) / ratio
        for name, size in (("x", "width"), ("y", "height"))
    )
    return {"x": left, "y": top, "width": right - left, "height": bottom - top}


def seen(page: Page, middle: Floats, half: tuple[float, float]) -> Floats:
    """What the page shows around a place: (rows, columns, 3) of red, green and blue."""
    clip: Any = {
        "x": float(middle[0] - half[0]),
        "y": float(middle[1] - half[1]),
        "width": 2 * half[0],
        "height": 2 * half[1],
    }
    return decoded(page.screenshot(clip=clip))


def decoded(picture: bytes) -> Floats:
    """The pixels of a PNG."""
    pixels = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    return pixels[..., ::-1].astype(float)


def screen(page: Page, camera: str, place: Floats, scale: float | None = None, middle: Floats | None = None) -> Floats:
    """Where a place of an image is on the page, if the whole image is in sight or `middle` in the middle, CSS px."""
    box = canvas_of(page, camera)
    shown = scale or min(box["width"] / SIZE[0], box["height"] / SIZE[1])
    centre = np.array([SIZE[0] - 1, SIZE[1] - 1]) / 2 if middle is None else middle
    return (place - centre) * shown + [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
