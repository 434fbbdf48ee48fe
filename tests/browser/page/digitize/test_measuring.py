"""Measuring with the mouse, with keys alone, with a finger, and in two browsers at once."""

import re
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from rig.arrays import Floats
from tests.analysis.simulated import SIZE
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import OPERATOR, PULSE, Desk, canvas_of, enter, screen, seen, settled
from tests.browser.touch import Fingers
from tests.support.repeats import repeats
from tests.support.waiting import wait_until

#: The pulse in which a ski is drawn: no image shows the other one over it. Where that lies, what is seen of a ski is
#: near the least that is accepted, and the shake of the hand decides.
APART = 16
#: Colour of the curves that come from K1, as `overlay.js` has it.
RED = np.array([255, 107, 107])


def _thing(page: Page, thing: str) -> Any:
    return page.locator(f'[data-thing="{thing}"]')


def _signs(page: Page, thing: str) -> list[str | None]:
    return [sign.get_attribute("data-letter") for sign in _thing(page, thing).locator(".sign").all()]


def _curve_height(page: Page, camera: str, at: Floats) -> float:
    """How far below (or above) a place on the page a curve from K1 is drawn, CSS px."""
    alike = np.abs(seen(page, at, (2.5, 60.5)) - RED).max(axis=2) < 40
    assert alike.any(), f"no curve in {camera}"
    return float(np.nonzero(alike.any(axis=1))[0].mean() - 60)


@pytest.mark.long
def test_a_point_in_three_views_with_curves_and_a_mistake(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1700, height=900)
    page.locator("#advance").select_option("view")
    page.locator("#loupe").select_option("0")
    where = {camera: screen(page, camera, desk.true(camera, "P1")) for camera in ("K1", "K2", "K3")}
    page.mouse.move(*where["K1"])
    expect(page.locator('[data-of="P1"][data-live="true"]')).to_be_visible()
    settled(page)
    assert abs(_curve_height(page, "K2", where["K2"])) < 2, "while the pointer moves"
    page.mouse.click(*where["K1"])
    expect(page.locator('.pane[data-camera="K2"]')).to_have_class(re.compile("active"))
    page.mouse.move(5, 5)
    settled(page)
    expect(page.locator('[data-of="P1"]')).to_contain_text("one ray")
    assert abs(_curve_height(page, "K2", where["K2"])) < 2, "of the mark"
    page.mouse.click(*where["K2"])
    page.mouse.click(*where["K3"])
    page.mouse.move(5, 5)
    expect(page.locator('[data-of="P1"]')).to_contain_text("controlled")
    expect(_thing(page, "P2")).to_have_attribute("aria-pressed", "true")
    found = desk.view()["space"]["P1"]
    off = np.array(found["X"]) - desk.log.truth[PULSE]["points"]["P1"]
    assert (np.abs(off) < 5 * np.array(found["sigma"])).all()
    expect(page.locator("#findings")).to_be_empty()
    box = canvas_of(page, "K2")
    page.mouse.move(*where["K2"])
    page.mouse.down()
    page.mouse.move(*np.add(where["K2"], [4, 20]), steps=4)
    page.mouse.move(*np.add(where["K2"], [8, 40]), steps=4)
    page.mouse.up()
    expect(page.locator("#findings")).to_contain_text("K2's P1 does not fit")
    expect(page.locator('[data-of="P1"] [data-fit="wrong"]').first).to_be_visible()
    assert canvas_of(page, "K2") == box, "what is told moves no picture"
    page.locator("#undo").click()
    expect(page.locator("#findings")).to_be_empty()
    page.locator("#tape").click()
    expect(page.locator("#tape-says")).to_be_visible()
    assert canvas_of(page, "K2") == box
    for camera in ("K1", "K2"):
        page.mouse.click(*screen(page, camera, desk.true(camera, "P3")))
    for camera in ("K1", "K2"):
        page.mouse.click(*screen(page, camera, desk.true(camera, "P4")))
    length = np.linalg.norm(np.subtract(*(desk.log.truth[PULSE]["points"][name] for name in ("P3", "P4"))))
    expect(page.locator("#tape-says")).to_contain_text(re.compile(rf"Length {length:.1f}"))


@pytest.mark.long
def test_a_jump_measured_with_keys_alone(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1280, height=900, reduced_motion="reduce")
    page.keyboard.press("Enter")  # the crosshair is in the middle
    for _ in range(3):
        page.keyboard.press("l")
    page.keyboard.press("Enter")
    expect(_thing(page, "P2")).to_have_attribute("aria-pressed", "true")
    desk.wait_for(1)
    first = desk.mark("K1", "P1")
    assert first is not None
    page.keyboard.press("ArrowRight")  # what was placed last, as nothing is said of the next one
    page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press(".")
    expect(page.locator("#sigma")).to_have_value("0.625")
    desk.wait_for(4)
    moved = desk.mark("K1", "P1")
    assert moved is not None
    assert np.subtract(moved["xy"], first["xy"]) == pytest.approx([0.1, -1.0], abs=1e-9)
    assert moved["sigma"] == [0.625, 0.625]
    page.keyboard.press("c")
    expect(_thing(page, "P3")).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("v")
    page.keyboard.press("b")
    expect(page.locator("#guess-next")).to_be_visible()
    page.keyboard.press("Enter")
    expect(_thing(page, "right ski")).to_have_attribute("aria-pressed", "true")
    for _ in range(2):
        page.keyboard.press("l")
        page.keyboard.press("Enter")
    expect(_thing(page, "left ski")).to_have_attribute("aria-pressed", "true")
    assert [_signs(page, name)[0] for name in ("P1", "P2", "P3", "P4", "right ski")] == ["m", "h", "n", "g", "m"]
    expect(page.locator(".pane.active .pane-stated")).to_have_text("P2 hidden, P3 not visible")
    desk.wait_for(9)
    kept = desk.session()
    done = kept["undo"]
    assert done == 9
    for _ in range(done):
        page.keyboard.press("z")
    desk.wait_for(2 * done)
    expect(page.locator("#undo")).to_be_disabled()
    assert not any(desk.view()["marks"].values())
    for _ in range(done):
        page.keyboard.press("Shift+Z")
    desk.wait_for(3 * done)
    expect(page.locator("#redo")).to_be_disabled()
    assert desk.session()["coverage"] == kept["coverage"]
    page.keyboard.press("x")
    page.keyboard.press("?")
    expect(page.get_by_role("heading", name="Help and keys")).to_be_visible()
    expect(page.locator("#keys-list")).to_contain_text("measure here next")
    page.keyboard.press("Escape")
    page.keyboard.press("End")
    expect(page.locator("#pulse-number")).to_have_text("20")
    page.keyboard.press("p")
    expect(page.locator("#play")).to_have_attribute("aria-label", "Pause")
    page.keyboard.press("p")


@pytest.mark.parametrize(
    ("size", "enlarged"), repeats([((360, 780), "1.6"), ((820, 1100), "3.7")]), ids=["phone", "tablet"]
)
def test_a_finger_places_where_the_loupe_shows_and_two_fingers_enlarge(
    desk: Desk, open_page: Open, size: tuple[int, int], enlarged: str
) -> None:
    """Three times as large as the whole picture."""
    page = enter(open_page, desk, width=size[0], height=size[1], has_touch=True, is_mobile=True)
    fingers = Fingers(page)
    box = canvas_of(page, "K1")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    fingers.down((x, y))
    for step in range(1, 6):
        fingers.move((x + 6 * step, y))
    settled(page)
    assert desk.mark("K1", "P1") is None, "while the finger is down"
    fingers.up()
    expect(_thing(page, "P2")).to_have_attribute("aria-pressed", "true")
    desk.wait_for(1)
    mark = desk.mark("K1", "P1")
    assert mark is not None
    assert np.abs(screen(page, "K1", np.array(mark["xy"])) - (x + 30, y)).max() < 0.05
    fingers.down((x - 40, y))
    fingers.drag(((x - 40, y), (x - 120, y)), ((x + 40, y), (x + 120, y)))
    expect(page.locator(".pane.active .pane-where")).to_contain_text(f"{enlarged}\u00d7")
    assert desk.session()["revision"] == 1, "two fingers measure nothing"


@pytest.mark.long
def test_two_browsers_on_one_session_see_each_other(desk: Desk, open_page: Open) -> None:
    first = enter(open_page, desk)
    second = enter(open_page, desk)
    at = screen(first, "K1", desk.true("K1", "P1"))
    first.mouse.click(*at)
    expect(_thing(second, "P1").locator(".sign").first).to_have_attribute("data-letter", "m")
    second.keyboard.press("c")
    second.keyboard.press("z")
    second.keyboard.press("z")
    expect(_thing(first, "P1").locator(".sign").first).to_have_attribute("data-letter", "")
    assert desk.session(OPERATOR)["redo"] == 2


@pytest.mark.long
def test_a_click_is_refined_and_followed_through_the_images(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1700, height=900)
    page.locator("#advance").select_option("view")
    for count, camera in enumerate(("K1", "K2", "K3")):
        page.mouse.click(*screen(page, camera, desk.true(camera, "P1")))
        desk.wait_for(2 * count + 1)
        page.keyboard.press("e")
        desk.wait_for(2 * count + 2)
        mark = desk.mark(camera, "P1")
        assert mark is not None
        assert mark["source"] == "refined"
        assert np.abs(np.array(mark["xy"]) - desk.true(camera, "P1")).max() < 0.5
    page.locator("#track-what").select_option("one")
    page.keyboard.press("a")
    expect(_thing(page, "P1")).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("2")
    expect(page.locator("#track-said")).to_contain_text(re.compile(r"P1 helmet: \d+ pulses"))
    page.keyboard.press("3")
    expect(page.locator("#pulse-number")).not_to_have_text(str(PULSE))
    expect(_thing(page, "P1").locator(".sign").first).to_have_attribute("data-letter", "t")
    page.keyboard.press("z")
    expect(_thing(page, "P1").locator(".sign").first).to_have_attribute("data-letter", "")
    assert set(desk.session()["coverage"]["P1"]["K1"]) == {str(PULSE)}, "one step takes the whole run back"


@pytest.mark.long
def test_a_ski_is_found_more_exactly_in_all_images_at_once(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1700, height=900)
    placed = 0
    for side in ("right", "left"):
        ski = desk.log.truth[PULSE]["skis"][side]
        ends = [np.array(ski["point"]) + s * np.array(ski["direction"]) for s in (-0.9, 0.8)]
        for camera in ("K1", "K2", "K3"):
            for place in (desk.image(camera, end) for end in ends):
                desk.place(camera, f"{side} ski", place)
                placed += 1
    desk.wait_for(placed)
    _thing(page, "right ski").click()
    page.keyboard.press("e")
    desk.wait_for(placed + 1)
    expect(_thing(page, "right ski").locator('.sign[data-letter="r"]')).to_have_count(3)
    ski = desk.log.truth[PULSE]["skis"]["right"]
    slope = desk.view()["lines"]["right ski"]["slope"]
    assert abs(slope["value"] - np.degrees(np.arcsin(ski["direction"][2]))) < 5 * slope["sigma"]


def test_a_pen_measures_and_the_palm_beside_it_does_not(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=820, height=1100, has_touch=True)
    page.locator("#advance").select_option("stay")
    page.locator("#view-large").click()  # all side by side: the palm is on another picture
    settled(page)
    pen, palm = page.context.new_cdp_session(page), Fingers(page)
    place, beside = (screen(page, camera, desk.true(camera, "P1")) for camera in ("K1", "K2"))

    def put(kind: str) -> None:
        where = {"x": float(place[0]), "y": float(place[1]), "button": "left", "clickCount": 1}
        pen.send("Input.dispatchMouseEvent", {"type": kind, "pointerType": "pen", "force": 0.4, **where})

    palm.down((float(beside[0]), float(beside[1])))
    put("mousePressed")
    palm.up()
    palm.down((float(place[0]) + 30, float(place[1])))
    put("mouseReleased")
    palm.up()
    desk.wait_for(1)
    settled(page)
    mark = desk.mark("K1", "P1")
    assert mark is not None
    assert np.abs(screen(page, "K1", np.array(mark["xy"])) - place).max() < 0.05
    assert desk.session()["revision"] == 1, "the palm has measured nothing"
    palm.down((float(beside[0]), float(beside[1])))  # without a pen it is a finger again
    palm.up()
    desk.wait_for(2)
    assert desk.mark("K2", "P1") is not None


def test_one_key_goes_to_the_worst_ray_the_next_open_place_and_where_a_click_helps_most(
    desk: Desk, open_page: Open
) -> None:
    for camera in ("K1", "K2", "K3"):
        for thing in ("P1", "P2", "P3", "P4"):
            if (camera, thing) != ("K3", "P2"):
                wrong = np.array([3.0, 12.0]) * ((camera, thing) == ("K2", "P3"))
                desk.place(camera, thing, desk.true(camera, thing) + wrong)
    page = enter(open_page, desk, width=1500, height=1000)
    page.keyboard.press("Home")
    page.keyboard.press("5")
    expect(_thing(page, "P3")).to_have_attribute("aria-pressed", "true")
    expect(page.locator('.pane[data-camera="K2"]')).to_have_class(re.compile("active"))
    expect(page.locator("#pulse-number")).to_have_text(str(PULSE))
    page.keyboard.press("t")
    expect(_thing(page, "right ski")).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("t")
    page.keyboard.press("t")
    expect(page.locator('.pane[data-camera="K3"]')).to_have_class(re.compile("active"))
    expect(_thing(page, "P2")).to_have_attribute("aria-pressed", "true")
    wanted = desk.client.get(f"/sessions/{OPERATOR}/next").json()
    page.keyboard.press("Home")
    page.keyboard.press("f")
    expect(page.locator("#snacks")).to_contain_text(wanted["why"])
    expect(_thing(page, wanted["thing"])).to_have_attribute("aria-pressed", "true")
    expect(page.locator(f'.pane[data-camera="{wanted["camera"]}"]')).to_have_class(re.compile("active"))
    expect(page.locator("#pulse-number")).to_have_text(str(wanted["pulse"]))


def test_the_pulse_before_stays_in_sight_as_a_ghost(desk: Desk, open_page: Open) -> None:
    desk.place("K1", "P1", desk.true("K1", "P1"))
    page = enter(open_page, desk, PULSE + 1, width=1500, height=1000)
    page.mouse.move(5, 5)
    at = screen(page, "K1", desk.true("K1", "P1"))
    settled(page)
    coloured = "the colour of the helmet's mark"  # the pulse before is fetched after the frame
    wait_until(lambda: bool(np.ptp(seen(page, at, (12, 12)), axis=2).max() > 40), coloured)
    page.keyboard.press("o")
    expect(page.locator("#view-ghost")).to_have_attribute("aria-pressed", "false")
    settled(page)
    assert np.ptp(seen(page, at, (12, 12)), axis=2).max() <= 1, "grey"
    assert desk.mark("K1", "P1", PULSE + 1) is None


def test_what_was_measured_automatically_is_taken_over_by_one_key_and_never_redone(desk: Desk, open_page: Open) -> None:
    for camera in ("K1", "K2", "K3"):
        for thing in ("P1", "P2"):
            desk.place(camera, thing, desk.true(camera, thing))
    found = desk.client.get(f"/sessions/{OPERATOR}/export/measurements.json")
    measured = desk.log_in_panel.with_suffix(".measured")
    measured.mkdir()
    (measured / "measurements.json").write_bytes(found.content)
    page = enter(open_page, desk, operator="Bo", width=1500, height=1000)
    expect(page.locator('[data-of="P1"]')).to_contain_text("controlled")  # it counts without a click
    page.locator("#advance").select_option("view")
    page.mouse.click(*screen(page, "K2", np.add(desk.true("K2", "P1"), (2, 0))))
    wait_until(lambda: desk.session("Bo")["revision"] == 1, "his own click is kept")
    page.keyboard.press("Shift+R")
    wait_until(lambda: desk.session("Bo")["revision"] == 6, "the rest is taken over")
    marks = desk.view(operator="Bo")["marks"]
    sources = {(camera, thing): mark["source"] for camera, of in marks.items() for thing, mark in of.items()}
    assert sources.pop(("K2", "P1")) == "hand"
    assert set(sources.values()) == {"automatic"}
    assert len(sources) == 5
    for camera, thing in sources:
        assert np.abs(np.array(marks[camera][thing]["xy"]) - desk.true(camera, thing)).max() < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("hand", ["mouse", "finger"])
def test_a_ski_that_is_drawn_in_two_images_is_found_in_all(desk: Desk, open_page: Open, hand: str) -> None:
    """The hand shakes by a pixel or two. What it drew stands until two images have the ski."""
    touch: dict[str, Any] = {"has_touch": True, "is_mobile": True} if hand == "finger" else {}
    page = enter(open_page, desk, APART, width=1366, height=1024, **touch)
    page.locator("#loupe").select_option("0")
    for camera in ("K1", "K2"):
        page.locator(f'.pane[data-camera="{camera}"] .pane-name').click() if camera != "K1" else None
        _thing(page, "right ski").click()
        expect(page.locator(f'.pane[data-camera="{camera}"]')).to_have_class(re.compile("active"))
        _draw(page, camera, _ends(desk, camera), hand)
        if camera == "K1":
            expect(_signs_of(page, "right ski", 0)).to_have_attribute("data-letter", re.compile("[mr]"))
            line = _kept_line(desk, "K1")
            assert all(_beside(desk, "K1", vertex["xy"]) < 2.5 for vertex in line["vertices"])
            if line["vertices"][0]["source"] == "hand":  # no edge was sure: nothing better than a hand is said
                assert {vertex["sigma"] for vertex in line["vertices"]} == {None}
    expect(page.locator("#track-said li")).to_contain_text("it was refined", timeout=60_000)
    expect(_thing(page, "right ski").locator('.sign:is([data-letter="r"], [data-letter="t"])')).to_have_count(3)
    ski = desk.log.truth[APART]["skis"]["right"]
    slope = desk.view(APART)["lines"]["right ski"]["slope"]
    assert abs(slope["value"] - np.degrees(np.arcsin(ski["direction"][2]))) < 5 * slope["sigma"]


def test_a_wheel_that_turns_as_a_picture_changes_its_size_zooms_about_the_pointer(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1366, height=1024)
    page.locator("#loupe").select_option("0")
    before = canvas_of(page, "K1")
    page.evaluate("""() => {
        const canvas = document.querySelector('.pane[data-camera="K1"] canvas');
        canvas.style.width = "50%";
        const { left, top, width, height } = canvas.getBoundingClientRect();
        const middle = { clientX: left + width / 2, clientY: top + height / 2 };
        canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -800, cancelable: true, ...middle }));
    }""")
    settled(page)
    box = canvas_of(page, "K1")
    assert box["width"] < 0.6 * before["width"]
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    desk.wait_for(1)
    mark = desk.mark("K1", "P1")
    assert mark is not None
    assert mark["xy"] == pytest.approx((np.array(SIZE) - 1) / 2, abs=1.0)


def _kept_line(desk: Desk, camera: str) -> dict[str, Any]:
    """The right ski as it is kept, once all its points are: the page shows the first one before."""
    lines: list[dict[str, Any]] = []

    def whole() -> bool:
        line = desk.mark(camera, "right ski", APART)
        if line is not None:
            lines.append(line)
        return line is not None and len(line["vertices"]) == (5, 2)[line["vertices"][0]["source"] == "refined"]

    wait_until(whole, f"the line in {camera} is kept")
    return lines[-1]


def _signs_of(page: Page, thing: str, image: int) -> Any:
    return _thing(page, thing).locator(".sign").nth(image)


def _ends(desk: Desk, camera: str) -> list[Floats]:
    ski = desk.log.truth[APART]["skis"]["right"]
    return [desk.image(camera, np.array(ski["point"]) + s * np.array(ski["direction"])) for s in (-0.9, 0.9)]


def _beside(desk: Desk, camera: str, place: list[float]) -> float:
    """How far a place is beside the axis of the right ski, px."""
    first, last = _ends(desk, camera)
    along = (last - first) / np.hypot(*(last - first))
    return float(abs((np.array(place) - first) @ (-along[1], along[0])))


def _draw(page: Page, camera: str, ends: list[Floats], hand: str) -> None:
    """Draw from one place of an image to another, enlarged."""
    middle = (ends[0] + ends[1]) / 2
    at = np.round(screen(page, camera, middle))
    page.mouse.move(*at)
    before = page.locator(".pane.active .pane-where").inner_text()
    page.mouse.wheel(0, -800)
    expect(page.locator(".pane.active .pane-where")).not_to_have_text(before)
    box = canvas_of(page, camera)
    scale = min(box["width"] / SIZE[0], box["height"] / SIZE[1]) * np.exp(0.0018 * 800)
    first, last = (at + (end - middle) * scale for end in ends)
    way = [first + k / 12 * (last - first) + (0, 1.5 * scale / 5 * (-1) ** k) for k in range(13)]
    places = [(float(x), float(y)) for x, y in way]
    if hand == "mouse":
        page.mouse.move(*places[0])
        page.mouse.down()
        for place in places[1:]:
            page.mouse.move(*place)
        page.mouse.up()
    else:
        fingers = Fingers(page)
        fingers.down(places[0])
        for place in places[1:]:
            fingers.move(place)
        fingers.up()
