"""What comes of the marks: findings in the reader's language, orientation by balls, a computed jump, files."""

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.analysis.simulated import SIZE, training
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import OPERATOR, PULSE, Desk, canvas_of, enter, screen
from tests.support.waiting import wait_until

CAMERAS = ("K1", "K2", "K3")


def _mark(desk: Desk, camera: str, thing: str, xy: np.ndarray, pulse: int = PULSE) -> None:
    x, y = xy.tolist()
    action = {"do": "place", "pulse": pulse, "camera": camera, "thing": thing, "xy": [x, y], "sigma": [0.3, 0.3]}
    answer = desk.client.post(f"/sessions/{OPERATOR}/actions", json=action)
    assert answer.status_code == 200, answer.text


def test_what_the_service_says_is_in_the_language_of_the_page(desk: Desk, open_page: Open) -> None:
    for camera in CAMERAS:
        _mark(desk, camera, "P1", desk.true(camera, "P1"))
        _mark(desk, camera, "P3", desk.true(camera, "P3") + (8, 40) * np.array(camera == "K2"))
    page = enter(open_page, desk, locale="nb-NO")
    expect(page.locator("#findings")).to_have_text(re.compile(r"^P3 i K2 passer ikke: \d+(,\d)? px, w = \d+(,\d)?$"))
    expect(page.locator('[data-of="P3"] .misfit')).to_contain_text("passer ikke")
    page.keyboard.press("2")
    expect(page.locator("#track-state")).to_contain_text("motsier hverandre eller dem fra før", timeout=30_000)
    page.locator("#track-what").select_option("one")
    page.locator("#track-on").click()
    said = "P1 hjelm: 10 pulser; puls 21: loggen slutter"
    expect(page.locator("#track-said li")).to_have_text(said, timeout=30_000)
    page.locator("#orient-clicked").click()
    expect(page.locator("#orientation-message")).to_contain_text("et bilde trenger 4 klikkede baller eller flere")


@pytest.mark.long
def test_balls_that_were_clicked_orient_the_cameras(desk_by_survey: Desk, open_page: Open) -> None:
    desk = desk_by_survey
    scenario = training()
    for camera in CAMERAS:
        projection = scenario.cameras[scenario.camera_index(camera)].projection(*SIZE)
        for ball in scenario.balls:
            px = projection.pixels(np.array(ball.X))
            if np.isfinite(px).all() and (px > 5).all() and (px < np.array(SIZE) - 5).all():
                _mark(desk, camera, f"ball:{ball.name}", px, pulse=1)
    page = enter(open_page, desk)
    expect(page.locator("#orientation-clicked")).to_contain_text("K1 ")
    page.locator("#orient-clicked").click()
    expect(page.locator("#orientation-lamp")).to_have_attribute("data-level", "info")
    expect(page.locator("#orientation-lamp")).to_have_attribute("data-level", "good", timeout=30_000)
    expect(page.locator("#orientation-message")).to_be_empty()
    expect(page.locator("#orient-clicked")).to_be_enabled()


@pytest.mark.long
@pytest.mark.alone
@pytest.mark.timeout(400)
def test_curves_follow_while_one_measures_and_a_click_on_one_goes_to_its_pulse(desk: Desk, open_page: Open) -> None:
    for pulse in range(6, 15):
        for camera in CAMERAS:
            for thing in ("P1", "P2", "P3", "P4"):
                _mark(desk, camera, thing, desk.true(camera, thing, pulse), pulse)
    page = enter(open_page, desk, width=1500, height=1000)
    picture = canvas_of(page, "K1")
    curve, curves = page.locator('#curves [data-of="height"]'), page.locator("#curves")
    expect(curve).to_be_visible(timeout=100_000)  # nobody asked to compute
    expect(page.locator("#result-state")).to_have_text("Nothing is computed yet.")
    assert canvas_of(page, "K1") == picture, "curves that come move no picture"
    before = curve.locator(".line").get_attribute("d") or ""
    assert before.count("L") == 8, "nine pulses"
    plot = curve.locator(".plot")
    plot.focus()
    for thing in ("P1", "P2", "P3"):  # faster than curves are computed: the newest marks win, and no click waits
        page.locator(f'[data-thing="{thing}"]').click()
        page.mouse.click(*screen(page, "K1", np.add(desk.true("K1", thing), 1.5)))
    plot.focus()
    desk.wait_for(9 * 12 + 3)
    expect(curves).to_have_attribute("data-revision", str(9 * 12 + 3), timeout=100_000)
    expect(curves).to_have_attribute("aria-busy", "false")
    assert curve.locator(".line").get_attribute("d") != before
    expect(plot).to_be_focused()  # by its newest curve, too
    known = desk.client.get(f"/sessions/{OPERATOR}/curves").json()["curves"]
    assert {"height", "speed"} <= known.keys()
    assert curves.locator("figure").count() == len(known)
    box = plot.bounding_box()
    assert box is not None
    for share, pulse in ((0.02, 6), (0.5, 10), (0.98, 14)):
        plot.click(position={"x": share * box["width"], "y": box["height"] / 2})
        expect(page.locator("#pulse-number")).to_have_text(str(pulse))
    page.keyboard.press("ArrowLeft")
    expect(page.locator("#pulse-number")).to_have_text("13")
    box = plot.bounding_box()
    assert box is not None
    assert box["y"] + box["height"] < 1000, "they are on the screen with the pictures"
    page.locator("#following > summary").click()
    page.reload()
    expect(page.locator("#following")).not_to_have_attribute("open", "")


@pytest.mark.long
def test_a_jump_is_computed_goes_out_as_a_file_and_comes_back(desk: Desk, open_page: Open, tmp_path: Path) -> None:
    for pulse in range(6, 15):
        for camera in CAMERAS:
            for thing in ("P1", "P2", "P3", "P4"):
                _mark(desk, camera, thing, desk.true(camera, thing, pulse), pulse)
    page = enter(open_page, desk)
    page.locator("#compute").click()
    page.locator("#compute-cancel").click()
    expect(page.locator("#result-state")).to_have_text("Nothing is computed yet.")
    page.locator("#compute").click()
    expect(page.locator("#result-share")).to_be_visible()
    expect(page.locator("#result-state")).to_contain_text("Computed.", timeout=60_000)
    expect(page.locator("#result-share")).to_be_hidden()
    expect(page.locator("#result-files a").filter(has_text="Coach's page")).to_be_visible()
    page.locator(".desk-more > details:last-child > summary").click()
    with page.expect_download() as download:
        page.locator("#exports a").filter(has_text="marks.csv").click()
    kept = tmp_path / "marks.csv"
    download.value.save_as(kept)
    before = desk.view()["marks"]
    answer = desk.client.post(
        f"/sessions/{OPERATOR}/actions", json={"do": "remove", "pulse": PULSE, "camera": "K1", "thing": "P1"}
    )
    assert answer.status_code == 200
    page.locator("#import-file").set_input_files(kept)
    wait_until(lambda: desk.view()["marks"] == before, "the marks are back")


def test_two_operators_are_compared_on_the_page(desk: Desk, open_page: Open) -> None:
    random = np.random.default_rng(5)
    for operator, beside in ((OPERATOR, 0.0), ("Bo", 0.8)):
        for pulse in range(8, 13):
            for camera in CAMERAS:
                for thing in ("P1", "P2", "P3", "P4"):
                    x, y = (desk.true(camera, thing, pulse) + random.normal(0, 0.3, 2) + (beside, 0)).tolist()
                    action = {"do": "place", "pulse": pulse, "camera": camera, "thing": thing, "xy": [x, y]}
                    assert desk.client.post(f"/sessions/{operator}/actions", json=action).status_code == 200
    page = enter(open_page, desk)
    page.locator(".desk-more > details:last-child > summary").click()
    page.locator("#compare").click()
    row = page.locator("#compare-table tbody tr").filter(has_text="P1 helmet")
    expect(row).to_contain_text("px")
    cells = row.locator("td").all_inner_texts()
    assert cells[0] == "15"
    assert 0.15 < float(cells[1].removesuffix(" px")) < 0.6, "one click of one operator, 0.3 px"
    mine, his = (float(cell.split(", ")[0]) for cell in cells[2:4])
    assert his - mine == pytest.approx(0.8, abs=0.4)
    expect(page.locator("#compare-table tbody tr").filter(has_text="Z₀")).to_be_visible()
