"""The calibration helper of the Focus view: what it says and offers, and the whole of it with the real service."""

import json
import re
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from mcap.reader import make_reader
from playwright.sync_api import Page, expect
from scipy.stats import chi2

from rig.api.calibrating import CalibratedLens, CalibratingOrder, CalibratingState, SeenTarget
from rig.api.statement import Level, Statement
from rig.settings.file import CONFIG, load_rig
from simrig.world.scenario import load_scenario
from tests.browser.conftest import Open
from tests.browser.jumps.test_training import arm
from tests.browser.views import AXE, BROKEN, SMALLEST_TOUCH_PX, TOO_SMALL, assert_fits_a_phone
from tests.service.serving import serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import CAMERAS, MemoryService
from tests.webpanel.serving import Panel

_TURN: Final = Statement(
    code="target_roll",
    text="turn the camera or the target by 90 degrees about the line of sight: 1 of 2 such pictures",
    values={"count": 1, "wanted": 2},
)
_MORE: Final = Statement(code="target_more", text="take more pictures: 4 of 9 to 15", values={"count": 4, "wanted": 9})
_SEEN: Final = tuple(
    SeenTarget(
        camera=name,
        width=160,
        height=120,
        corners=((40.0, 30.0), (60.5, 31.0), (41.0, 50.5)),
        pictures=4,
        cells=tuple(tuple((x + y) % 3 for x in range(8)) for y in range(6)),
        missing=(_TURN, _MORE) if name == "K1" else (),
    )
    for name in CAMERAS
)


def _lens(name: str, *, good: bool) -> CalibratedLens:
    words = "good enough" if good else "NOT good enough"
    values: dict[str, Any] = {"camera": name, "wanted": "1000", "lens_px": 0.0083, "one_to": 77000, "needed": 3000}
    text = (
        f"camera {name}: {words} for 1:1000: the lens is known to 0.0083 px (1:77000 of the picture's width; 1:3000 is "
        "needed)"
    )
    return CalibratedLens(
        camera=name,
        good=good,
        verdict=Statement(code="target_good" if good else "target_not_good", text=text, values=values),
        advice=() if good else (_MORE,),
        residuals=((30.0, 40.0, 0.004, 0.0), (90.0, 60.0, 0.0, -0.02)),
    )


def _grave(page: Page) -> list[str]:
    page.evaluate(AXE.read_text())
    found: dict[str, Any] = page.evaluate("axe.run('#aim', { resultTypes: ['violations'] })")
    return [f"{each['id']}: {each['nodes'][0]['html']}" for each in found["violations"] if each["impact"] != "minor"]


def _assert_sound(page: Page) -> None:
    """Axe finds nothing, nothing is cut off or too small for a glove."""
    assert _grave(page) == []
    assert page.evaluate(BROKEN) == []
    assert not page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX)


def test_it_says_what_to_show_and_offers_what_can_be_done(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    page = open_page(f"{panel.url}/#/aim", width=360, height=780, color_scheme="dark", has_touch=True)
    service.arm()
    expect(page.locator("#aim-image")).not_to_have_js_property("naturalWidth", 0)
    page.get_by_text("What was printed").click()
    across = page.get_by_role("spinbutton", name="Squares across")
    across.fill("")
    page.get_by_role("button", name="Take pictures").click()
    expect(across).to_be_focused()  # it says what is wrong with it
    assert service.calibrating.orders == []
    across.fill("11")
    service.calibrating.show(cameras=_SEEN, taken=4)
    page.get_by_role("button", name="Take pictures").click()
    expect(page.locator("#calibrating-said")).to_have_text("Target found. Hold it still.")
    assert (service.calibrating.orders[0].columns, service.calibrating.orders[0].anew) == (11, False)
    expect(page.locator("#calibrating-missing li")).to_have_text([_TURN.text, _MORE.text])
    expect(page.locator("#calibrating-over circle")).to_have_count(3)
    expect(page.locator("#calibrating-over .has")).to_have_count(32)
    boxes = "ids => ids.map(id => JSON.stringify(document.getElementById(id).getBoundingClientRect()))"
    live, over = page.evaluate(boxes, ["aim-image", "calibrating-over"])
    assert live == over
    _assert_sound(page)
    assert_fits_a_phone(page)
    page.locator("#aim-cameras button").nth(1).click()
    expect(page.locator("#calibrating-missing li")).to_have_text(["K2 has all it needs."])
    service.calibrating.show(still=True)
    expect(page.locator("#calibrating-said")).to_have_text("Still. Now move it to another pose.")
    service.calibrating.show(state=CalibratingState.HELD)
    expect(page.locator("#calibrating-said")).to_have_text("Waits while a recording runs.")
    service.calibrating.show(
        state=CalibratingState.LOOKING,
        problem=Statement(level=Level.WARNING, code="target_mirrored", text="it is mirrored", advice="turn it off"),
    )
    expect(page.locator("#calibrating-problem")).to_have_text("it is mirrored: turn it off")
    page.get_by_role("button", name="Take the last one back").click()
    expect(page.locator("#calibrating-counts dd").first).to_have_text("3")
    service.calibrating.show(problem=None)
    page.get_by_role("button", name="Compute the calibration").click()
    expect(page.locator("#calibrating-said")).to_contain_text("being computed")
    expect(page.get_by_role("button", name="Stop", exact=True)).to_be_visible()
    service.disarm()
    lenses = tuple(_lens(name, good=name != "K3") for name in CAMERAS)
    service.calibrating.show(state=CalibratingState.DONE, lenses=lenses)
    expect(page.locator(".lens")).to_have_count(3)
    expect(page.locator(".lens").first).to_be_in_viewport()
    expect(page.locator(".lens").nth(2)).to_contain_text("Not good enough for 1:1000")
    expect(page.locator(".lens").nth(2)).to_contain_text(_MORE.text)
    expect(page.locator("#calibrating-residuals .arrow")).to_have_count(2)
    expect(page.locator("#calibrating-residuals-words")).to_contain_text("the longest is 0.020 px")
    _assert_sound(page)
    page.get_by_role("button", name="Put it into the rig file").click()
    expect(page.locator("#calibrating-saved")).to_be_visible()
    assert service.calibrating.shown.saved


def test_pictures_go_on_with_what_was_printed_after_the_page_was_loaded_anew(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    printed = CalibratingOrder(columns=8, rows=5, square_mm=45.5, target_mm=150.0)
    service.calibrating.show(cameras=_SEEN, taken=4, printed=printed)
    page = open_page(f"{panel.url}/#/aim")
    go_on = page.get_by_role("button", name="Go on taking pictures")
    expect(go_on).to_be_visible()
    page.get_by_text("What was printed").click()
    expect(page.get_by_role("spinbutton", name="Squares across")).to_have_value("8")
    page.get_by_role("spinbutton", name="Squares down").fill("7")
    service.calibrating.show(taken=5)
    expect(page.locator("#calibrating-counts dd").first).to_have_text("5")
    expect(page.get_by_role("spinbutton", name="Squares down")).to_have_value("7")  # what one types stays
    page.get_by_role("spinbutton", name="Squares down").fill("5")
    go_on.click()
    expect(page.get_by_role("button", name="Stop", exact=True)).to_be_visible()
    assert service.calibrating.orders == [printed]


@pytest.mark.parametrize(("look", "width"), [("light", 768), pytest.param("dark", 1280, marks=pytest.mark.long)])
def test_it_is_said_in_norwegian_on_a_wider_screen(
    panel: Panel, service: MemoryService, open_page: Open, look: str, width: int
) -> None:
    service.arm()
    lenses = tuple(_lens(name, good=name != "K3") for name in CAMERAS)
    service.calibrating.show(state=CalibratingState.LOOKING, cameras=_SEEN, taken=4)
    page = open_page(f"{panel.url}/#/aim", width=width, height=1000, locale="nb-NO", color_scheme=look)
    expect(page.locator("#calibrating-missing li").first).to_have_text(
        "drei kameraet eller målet 90 grader om siktelinjen: 1 av 2 slike bilder"
    )
    _assert_sound(page)
    service.calibrating.show(state=CalibratingState.DONE, lenses=lenses)
    expect(page.locator(".lens").first).to_contain_text("objektivet er kjent til 0,0083 px (1:77 000 av bildets bredde")
    expect(page.locator(".lens").nth(2)).to_contain_text("ta flere bilder: 4 av 9 til 15")
    _assert_sound(page)


#: The two cameras of the whole way, and how long it may take with the processor time that nobody else wants.
_NAMES: Final = ("K2", "K3")
_PATIENCE_S: Final = 240.0
#: That a calibration is taken for wrong which is not.
_CHANCE: Final = 1e-4


def _board_rig(folder: Path, loopback: Loopback) -> Path:
    """A rig with a calibration scenario whose poses change quickly."""
    scenario = CONFIG / "scenarios" / "calibration.toml"
    (folder / "scenario.toml").write_text(f'base = "{scenario}"\n[board]\nstill_s = 3.0\nmoving_s = 0.3\n')
    cameras = "".join(f'[[cameras]]\nname = "{name}"\nbackend = "sim"\n' for name in _NAMES)
    rig = folder / "rig.toml"
    rig.write_text(
        'name = "board"\n# as it was delivered\n[trigger]\nsource = "external"\nrate_hz = 10.0\n[simulation]\n'
        f'scenario = "scenario.toml"\n[network]\npublish = "{loopback.endpoint()}"\n{cameras}'
    )
    return rig


def _assert_agrees(result: dict[str, Any], scenario: Path) -> None:
    """The calibrated cameras are the simulated ones: their errors together are such as their covariance allows.

    Eleven parameters one by one would be beyond 2.5 sigma in one of eight runs by chance; which pictures are kept, and
    so their noise, differs from run to run.
    """
    assert 0.9 < result["global_test"]["ratio"] < 1.1
    truth = load_scenario(scenario)
    for name in _NAMES:
        camera = truth.cameras[truth.camera_index(name)]
        true, found = {"c": camera.c, **camera.lens.model_dump()}, result["cameras"][name]
        off = np.array([(found[each] - true[each]) / sigma for each, sigma in found["sigma"].items()])
        names = list(found["sigma"])
        together = np.eye(len(names))
        for pair, value in found["correlations"].items():
            i, j = (names.index(each) for each in pair.split("|"))
            together[i, j] = together[j, i] = value
        assert off @ np.linalg.solve(together, off) < chi2.ppf(1.0 - _CHANCE, len(off)), (name, off)


def _attached(log: Path) -> dict[str, Any]:
    """`calibration.json` of a log."""
    with log.open("rb") as file:
        found = {each.name: each.data for each in make_reader(file).iter_attachments()}
    content: dict[str, Any] = json.loads(found["calibration.json"])
    return content


@pytest.mark.long
@pytest.mark.alone
@pytest.mark.timeout(600)
def test_a_board_held_before_the_cameras_calibrates_them(tmp_path: Path, loopback: Loopback, open_page: Open) -> None:
    rig = _board_rig(tmp_path, loopback)
    with serving(tmp_path, rig, loopback) as service:
        page = open_page(service.url, width=360, height=780)
        arm(page)
        page.goto(f"{service.url}/#/aim")
        page.get_by_role("button", name="Take pictures").click()
        pulses = page.locator("#calibrating-counts dd").first

        def taken() -> int:
            return int(pulses.inner_text() or 0)

        wait_until(lambda: taken() >= 2, "pictures are kept by themselves", _PATIENCE_S, 0.2)
        recording = service.post("/api/recordings")["id"]
        expect(page.locator("#calibrating-said")).to_have_text("Waits while a recording runs.")
        refused_then = service.call("POST", "/api/calibration/save")
        assert refused_then[0] == 409
        service.post(f"/api/recordings/{recording}/stop")
        wait_until(lambda: taken() >= 3, "it goes on", _PATIENCE_S, 0.2)
        before = service.get("/api/calibration")["taken"]
        page.get_by_role("button", name="Take the last one back").click()
        wait_until(lambda: taken() == before - 1, "the last one is gone", poll_s=0.02)
        wait_until(lambda: taken() >= 12, "there are enough", _PATIENCE_S, 0.2)
        expect(page.locator("#calibrating-missing li")).to_have_text([re.compile("has all it needs")])
        pictures = Path(service.get("/api/calibration")["folder"])
        page.get_by_role("button", name="Compute the calibration").click()
        expect(page.locator("#calibrating-said")).to_contain_text("being computed")
        service.post("/api/disarm")  # simulated cameras take the processor that the computing waits for
        good = page.locator('.lens[data-level="good"]')
        expect(good).to_have_count(len(_NAMES), timeout=_PATIENCE_S * 1000)
        expect(page.locator("#calibrating-residuals .arrow").first).to_be_attached()
        assert "good enough for 1:1000" in service.text("/api/calibration/protocol.html")
        page.get_by_role("button", name="Put it into the rig file").click()
        expect(page.locator("#calibrating-saved")).to_be_visible()
        service.post("/api/arm")
        service.await_state("armed")
        recording = service.post("/api/recordings")["id"]
        service.post(f"/api/recordings/{recording}/stop")
        log = service.data / f"{recording}.mcap"
    result = json.loads((pictures.parent / "calibration.json").read_bytes())
    _assert_agrees(result, tmp_path / "scenario.toml")
    assert load_rig(rig).calibration == pictures.parent / "calibration.json"
    assert "# as it was delivered" in rig.read_text()
    assert _attached(log)["cameras"] == result["cameras"]
