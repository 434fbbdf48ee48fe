"""At every size of window, in both languages: no word is broken, nothing is cut off, what is needed is in sight."""

import re
from datetime import UTC, datetime

import pytest
from playwright.sync_api import Locator, Page, expect
from playwright.sync_api import TimeoutError as NotInTimeError

from rig.api.statement import Level, Statement
from rig.api.status import Alarm, State
from tests.browser.conftest import MEASURED, Open
from tests.browser.touch import Fingers
from tests.browser.views import BROKEN, READY, enter
from tests.support.repeats import repeats
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel

PHONE, ACROSS, TABLET, SMALL_LAPTOP, LAPTOP = (360, 780), (780, 360), (768, 1024), (1024, 768), (1280, 800)
BESIDE_THE_MESSAGE = """element => {
    const snack = document.querySelector(".snack").getBoundingClientRect();
    const own = element.getBoundingClientRect();
    const across = snack.right <= own.left || own.right <= snack.left;
    return across || snack.bottom <= own.top || own.bottom <= snack.top;
}"""


@pytest.mark.parametrize(
    "size",
    repeats([[PHONE], [LAPTOP], [ACROSS], [TABLET], [SMALL_LAPTOP]]),
    ids="{0[0]}x{0[1]}".format,
)
def test_no_word_is_broken_and_nothing_is_cut_off(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, size: tuple[int, int]
) -> None:
    width, height = size
    service.jumpers.import_table("bib;athlete\n1;Berit Kristiansdatter Øvrebø\n2;Anna\n".encode())
    service.last_jump = MEASURED
    page = open_page(panel.url, width=width, height=height, reduced_motion="reduce")
    for language in ("en", "nb"):
        page.evaluate("language => localStorage.setItem('svev.language', JSON.stringify(language))", language)
        page.reload()
        expect(page.locator("html")).to_have_attribute("lang", language)
        for view in READY:
            enter(page, panel, view)
            assert page.evaluate("document.documentElement.scrollWidth") == width, (language, view)
            assert page.evaluate(BROKEN) == [], (language, view)
        page.goto(f"{panel.url}/#/live")
        for state in State:
            service._become(state)
            expect(page.locator("#state")).to_have_attribute("data-state", state.value)
            assert page.evaluate(BROKEN) == [], (language, state)


def in_sight(page: Page, element: Locator) -> bool:
    """Whether all of an element is in the window, and nothing lies over its middle."""
    found: bool = element.evaluate("""element => {
        const { left, top, right, bottom } = element.getBoundingClientRect();
        const front = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
        return top >= 0 && bottom <= innerHeight && left >= 0 && right <= innerWidth && element.contains(front);
    }""")
    return found


@pytest.mark.parametrize(
    "size", repeats([[PHONE], [SMALL_LAPTOP], [LAPTOP], [TABLET], [ACROSS]]), ids="{0[0]}x{0[1]}".format
)
def test_state_record_and_save_stay_in_sight_however_far_one_scrolls(
    panel: Panel, service: MemoryService, open_page: Open, size: tuple[int, int]
) -> None:
    lines = "".join(f"{bib};Jumper {bib}\n" for bib in range(1, 41))
    service.jumpers.import_table(f"bib;athlete\n{lines}".encode())
    service.last_jump = MEASURED
    service.arm()
    page = open_page(panel.url, width=size[0], height=size[1])
    expect(page.locator("#list-rows li")).to_have_count(40)
    state = page.locator("#state-word, #pill")
    for scrolled in ("0", "innerHeight", "document.documentElement.scrollHeight"):
        page.evaluate(f"scrollTo({{ top: {scrolled}, behavior: 'instant' }})")
        wait_until(
            lambda: any(in_sight(page, each) and "armed" in each.inner_text().lower() for each in state.all()),
            f"the state is in sight at {scrolled}",
        )
        assert in_sight(page, page.locator("#next-step"))
        assert in_sight(page, page.locator("#save-last"))


@pytest.mark.parametrize("size", repeats([[ACROSS], [SMALL_LAPTOP], [LAPTOP]]), ids="{0[0]}x{0[1]}".format)
def test_the_slider_of_a_jump_is_in_sight_also_with_one_camera_large(
    panel: Panel, jumps: None, open_page: Open, size: tuple[int, int]
) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-2", width=size[0], height=size[1])
    expect(page.locator("#frames img:not(.ghost)")).not_to_have_js_property("naturalWidth", 0)
    needed = [page.locator("#frame-slider"), page.locator("#frame-play")]
    assert all(in_sight(page, element) for element in needed)
    page.locator("#frames .block").nth(0).click()
    expect(page.locator("#frames")).to_have_class(re.compile("single"))
    assert all(in_sight(page, element) for element in needed)


@pytest.mark.parametrize("size", repeats([[PHONE], [SMALL_LAPTOP], [LAPTOP]]), ids="{0[0]}x{0[1]}".format)
def test_messages_cover_neither_the_next_jumper_nor_the_buttons(
    panel: Panel, service: MemoryService, open_page: Open, size: tuple[int, int]
) -> None:
    service.arm()
    page = open_page(panel.url, width=size[0], height=size[1])
    page.locator("#save-last").click()
    expect(page.locator(".snack")).to_be_visible()
    bib = page.get_by_role("textbox", name="Bib", exact=True).first
    bib.evaluate("element => element.scrollIntoView({ block: 'center' })")
    for element in (bib, page.locator("#next-step")):
        assert element.evaluate(BESIDE_THE_MESSAGE)


@pytest.mark.parametrize("size", repeats([[SMALL_LAPTOP], [PHONE]]), ids="{0[0]}x{0[1]}".format)
def test_four_alarms_and_a_refused_list_leave_record_and_save_in_reach(
    panel: Panel, service: MemoryService, open_page: Open, size: tuple[int, int]
) -> None:
    text = "numbers, times and arrivals of the frames of a camera contradict each other, and its frames are not used"
    said = Statement(level=Level.WARNING, code="", text=text, advice="disarm, restart the camera, and arm again")
    service.alarms = tuple(
        Alarm(number=number, topic=f"camera {number}", since=datetime.now(UTC), statement=said) for number in range(4)
    )
    service.arm()
    page = open_page(panel.url, width=size[0], height=size[1])
    expect(page.locator("#alarms li")).to_have_count(4)
    refused = {"name": "list.csv", "mimeType": "text/csv", "buffer": b"bib;athlete\n1;A\n1;B\n"}
    page.locator("#list-file").set_input_files(refused)  # type: ignore[arg-type]  # a list that is no file
    expect(page.locator(".snack")).to_contain_text("bib 1 stands in lines 2 and 3")
    assert in_sight(page, page.locator("#next-step"))
    assert in_sight(page, page.locator("#save-last"))
    right = {"name": "list.csv", "mimeType": "text/csv", "buffer": b"bib;athlete\n1;A\n2;B\n"}
    page.locator("#list-file").set_input_files(right)  # type: ignore[arg-type]
    expect(page.locator("#list-preview")).to_be_visible()
    expect(page.locator(".snack")).to_have_count(0)


@pytest.mark.parametrize("size", repeats([[SMALL_LAPTOP], [LAPTOP], [TABLET]]), ids="{0[0]}x{0[1]}".format)
def test_the_last_jump_is_large_enough_to_be_seen_and_its_words_are_whole(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, size: tuple[int, int]
) -> None:
    service.last_jump = MEASURED
    page = open_page(panel.url, width=size[0], height=size[1], locale="nb-NO", reduced_motion="reduce")
    page.locator("#measured").scroll_into_view_if_needed()
    expect(page.locator("#measured-replay")).to_have_attribute("data-stage", "ready")
    box = page.locator("#measured-replay canvas").bounding_box()
    assert box is not None
    assert box["height"] > 120
    assert page.evaluate(BROKEN) == []


def test_a_tablet_held_across_shows_all_figures_of_the_coachs_screen_in_one_row(
    panel: Panel, jumps: None, open_page: Open
) -> None:
    page = open_page(panel.url, width=SMALL_LAPTOP[0], height=SMALL_LAPTOP[1])
    enter(page, panel, "coach")
    figures = page.locator("#coach-figures > div")
    expect(figures).to_have_count(5)
    assert len({round(each["y"]) for figure in figures.all() if (each := figure.bounding_box())}) == 1
    wide = "elements => elements.every(each => each.scrollWidth <= each.parentElement.clientWidth)"
    assert page.locator("#coach-figures b").evaluate_all(wide)


def _swiped(page: Page, distance: int, camera: str) -> bool:
    """Swipe over the pictures: whether another camera is shown then, which must be `camera`."""
    shown = page.locator("#preview .block:visible .name")
    before = shown.inner_text()
    box = page.locator("#preview").bounding_box()
    assert box
    assert box["height"] > 200
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    Fingers(page).swipe((x, y), distance)
    try:
        expect(shown).not_to_have_text([before], timeout=5000)
    except AssertionError:
        return False
    assert shown.inner_text() == camera
    return True


def test_a_phone_shows_one_camera_large_and_swiping_shows_the_others(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(panel.url, width=360, height=780, has_touch=True, is_mobile=True)
    shown = page.locator("#preview .block:visible .name")
    expect(shown).to_have_text(["K1"])
    for distance, camera in ((-120, "K2"), (-120, "K3"), (-120, "K1"), (120, "K3")):
        # On a busy machine the browser may take a swipe for something else, which changes nothing.
        wait_until(lambda: _swiped(page, distance, camera), f"a swipe shows {camera}")  # noqa: B023
    # On a busy machine the browser may take a tap for a long press, which does nothing.
    wait_until(lambda: _tapped(page), "all cameras are shown")
    expect(shown).to_have_text(["K1", "K2", "K3"])


def _tapped(page: Page) -> bool:
    """Whether a tap on the one camera that is shown shows all of them."""
    shown = page.locator("#preview .block:visible")
    shown.first.tap()
    try:
        shown.nth(2).wait_for(timeout=1000)
    except NotInTimeError:
        return False
    return True
