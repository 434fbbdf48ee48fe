"""What the page shows and offers in each state of the rig."""

import re
import threading
from datetime import UTC, datetime

import pytest
from playwright.sync_api import Locator, Page, expect

from rig.api.jump import LastJump, MeasuredValue
from rig.api.recordings import Recording, RecordingOrder
from rig.api.statement import Level, Statement
from rig.api.status import AutomaticStatus, State, Status
from rig.errors import StateForbidsError
from tests.browser.conftest import Open
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel

HIDE = (
    "Object.defineProperty(document, 'hidden', { value: true }); document.dispatchEvent(new Event('visibilitychange'))"
)
PICTURE = re.compile("^blob:")


def test_an_unready_rig_offers_to_arm_and_nothing_else(panel: Panel, open_page: Open) -> None:
    page = open_page(panel.url)
    expect(page.locator("#state-word")).to_have_text("Idle")
    expect(page.locator("#next-step")).to_have_text("Arm")
    expect(page.locator("#save-last")).to_be_hidden()
    expect(page.locator("#disarm")).to_be_hidden()
    expect(page.locator("#preview")).to_have_class(re.compile("dark"))
    page.locator("#next-step").click()
    expect(page.locator("#state-word")).to_have_text("Armed")
    expect(page.locator("#next-step")).to_have_text("RecordNo name")


@pytest.mark.parametrize(
    ("state", "word", "button"),
    [
        (State.ARMING, "Arming", "Arming …"),
        (State.DISARMING, "Closing", "Closing …"),
        (State.FAULT, "Fault", "Arm again"),
    ],
)
def test_every_state_has_its_word_and_its_button(
    panel: Panel, service: MemoryService, open_page: Open, state: State, word: str, button: str
) -> None:
    service._become(state)
    page = open_page(panel.url)
    expect(page.locator("#state-word")).to_have_text(word)
    expect(page.locator("#state")).to_have_attribute("data-state", state.value)
    expect(page.locator("#next-step")).to_have_text(button)
    wanted = expect(page.locator("#next-step"))
    wanted.to_be_enabled() if state is State.FAULT else wanted.to_be_disabled()


def test_a_key_acts_on_the_view_that_the_key_before_it_opened(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service._become(State.ARMED)
    page = open_page(panel.url)
    expect(page.locator("#state-word")).to_have_text("Armed")
    page.keyboard.press("l")
    expect(page.locator("#log")).to_be_visible()
    page.evaluate("""() => {
        for (const key of ["v", "x"]) document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    }""")
    expect(page.locator("#live")).to_be_visible()
    expect(page.locator("#state-word")).to_have_text("Idle")


def test_the_jump_that_was_measured_last_is_shown_with_its_sigmas(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(panel.url)
    expect(page.locator("#state-word")).to_have_text("Armed")
    expect(page.locator("#measured")).to_be_hidden()
    values = {
        "takeoff_speed": MeasuredValue(value=26.104, sigma=0.0151),
        "perpendicular": MeasuredValue(value=2.1085, sigma=0.115),
        "speed_20_m": MeasuredValue(value=25.489, sigma=0.004),
        "angle_of_attack": MeasuredValue(value=19.5121, sigma=0.5),
    }
    write_recording(service.catalogue.directory, "jump-1")
    why = "only 3 of 17 pulses show both skis in flight (all points in 32 of 35 pulses in sight)"
    service.last_jump = LastJump(
        recording="jump-1", jump=1, time=datetime(2026, 2, 14, 10, 15, 30, tzinfo=UTC), ok=False, verdict=why, **values
    )
    service._become(State.ARMED)
    figures = page.locator("#measured-figures > div")
    expect(figures).to_have_text(
        [
            "Take-off speed26.104 ± 0.015\u202fm/s\n94.0\u202fkm/h",
            "Perpendicular to the table2.11 ± 0.12\u202fm/s",
            "Speed at 20 m25.489 ± 0.004\u202fm/s\n91.8\u202fkm/h",
            "Angle of attack, 0.5 s19.5° ± 0.5°",
            "Ski to body, 0.5 s\N{EN DASH}",
        ]
    )
    expect(page.locator("#measured-verdict")).to_have_attribute("data-level", "warning")
    expect(page.locator("#measured-why")).to_have_text(why)
    service.last_jump = service.last_jump.model_copy(update={"ok": True})
    norwegian = open_page(panel.url, width=360, height=780, locale="nb-NO")
    expect(norwegian.locator("#measured-verdict")).to_have_text("Godt målt")
    expect(norwegian.locator("#measured-why")).to_be_hidden()
    expect(norwegian.locator("#measured-figures > div").first).to_have_text(
        "Fart på kanten26,104 ± 0,015\u202fm/s\n94,0\u202fkm/h"
    )
    wide = (
        "[...document.querySelectorAll('#measured *')].filter(e => e.scrollWidth > e.clientWidth + 1 && e.clientWidth)"
    )
    assert norwegian.evaluate(f"{wide}.map(e => e.outerHTML)") == []


def test_a_refusal_is_shown_with_what_to_do(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(order: RecordingOrder) -> Recording:
        raise StateForbidsError("the disk is asleep: wake it first")

    service.arm()
    monkeypatch.setattr(service, "start_recording", refuse)
    page = open_page(panel.url)
    page.locator("#next-step[data-step=armed]").click()
    expect(page.get_by_role("alert").filter(has_text="the disk is asleep: wake it first")).to_be_visible()
    expect(page.locator("#next-step")).to_be_enabled()
    expect(page.locator("#next-step")).to_have_attribute("aria-busy", "false")


def _begun(panel: Panel, service: MemoryService, open_page: Open) -> tuple[Page, Locator]:
    """A page on which a recording has just been begun, and the button that began it and stops it."""
    service.arm()
    page = open_page(panel.url)
    button = page.locator("#next-step")
    expect(button).to_be_enabled()
    button.click()
    expect(button).to_have_text("Stophold to stop")
    return page, button


def test_a_second_tap_is_said_beside_the_button_and_a_long_press_stops(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    page, button = _begun(panel, service, open_page)
    button.click()
    expect(page.locator("#action-reason")).to_contain_text("has only just begun and goes on. Hold the button")
    assert service.state is State.RECORDING
    box = button.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 40, box["y"] + 40)
    page.mouse.down()
    expect(page.locator("#state-word")).to_have_text("Armed")
    page.mouse.up()
    expect(button).to_be_disabled()
    assert len(service.catalogue.entries()) == 1
    expect(page.locator("#snacks [data-level=error]")).to_have_count(0)


@pytest.mark.long
def test_a_long_press_stops_at_any_time_wherever_the_button_goes_and_its_end_is_no_tap(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    page, button = _begun(panel, service, open_page)
    expect(button).to_have_text("Stop")
    button.hover()
    page.mouse.down()
    button.evaluate("element => element.style.translate = '0 300px'")
    expect(page.locator("#state-word")).to_have_text("Armed")
    button.evaluate("element => element.style.translate = ''")
    expect(button).to_be_enabled()
    page.mouse.up()
    button.click()
    expect(page.locator("#state-word")).to_have_text("Recording")
    expect(page.locator("#action-reason")).to_be_hidden()
    assert len(service.catalogue.entries()) == 1  # the first one; the second one is still running


def test_a_switch_says_whether_recordings_begin_by_themselves(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(panel.url, width=360, height=780)
    expect(page.locator("#next-step")).to_be_enabled()
    expect(page.locator("#automatic")).to_be_hidden()
    service.automatic = AutomaticStatus(on=True, camera="K1")
    page.reload()
    switch = page.get_by_label("Records by itself when somebody comes into sight (K1)")
    expect(switch).to_be_checked()
    switch.uncheck()
    wait_until(lambda: service.automatic == AutomaticStatus(on=False, camera="K1"), "the service is told")
    expect(switch).not_to_be_checked()
    expect(page.locator(".snack")).to_contain_text("Recordings no longer begin by themselves")
    page.locator(".snack").get_by_role("button", name="Undo").click()
    expect(switch).to_be_checked()
    assert service.automatic == AutomaticStatus(on=True, camera="K1")
    expect(page.locator(".snack")).to_contain_text("Recordings begin by themselves")
    assert page.evaluate("document.documentElement.scrollWidth") == 360


def test_no_camera_is_not_green_and_old_news_hides_nothing_new(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = service.status
    service.arm()

    def with_trouble() -> Status:
        none = Statement(level=Level.ERROR, code="state_armed_none", text="armed, but none of the 3 cameras delivers")
        old = Statement(
            level=Level.ERROR, code="recording_ended", text="recording jump-1 ended early: the disk is full"
        )
        return usual().model_copy(update={"statement": none, "notice": old})

    monkeypatch.setattr(service, "status", with_trouble)
    page = open_page(panel.url)
    expect(page.locator("#state-text")).to_contain_text("none of the 3 cameras delivers")
    expect(page.locator("#state-notice")).to_contain_text("jump-1 ended early")
    colour = "e => getComputedStyle(e).backgroundColor"
    assert page.locator("#state").evaluate(colour) == "rgb(255, 179, 0)", "the colour of a fault"


def test_one_tap_arms_without_the_cameras_that_do_not_answer(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.fault = Statement(
        level=Level.ERROR,
        code="fault_too_few",
        text="2 of 3 cameras answer, 3 are needed: without K2",
        values={"present": 2, "cameras": 3, "least": 3, "missing": "K2"},
    )
    service.state = State.FAULT
    page = open_page(panel.url, width=360, height=780, locale="nb-NO")
    expect(page.locator("#state-text")).to_contain_text("2 av 3 kameraer svarer, 3 må til: uten K2")
    page.get_by_role("button", name="Gjør klar uten K2").click()
    wait_until(lambda: service.state is State.ARMED, "armed")
    expect(page.locator("#arm-without")).to_be_hidden()


def test_the_preview_runs_only_while_it_is_looked_at(panel: Panel, service: MemoryService, open_page: Open) -> None:
    service.arm()
    page = open_page(panel.url)
    image = page.locator("#preview img")
    expect(image).to_have_attribute("src", PICTURE)
    expect(image).not_to_have_js_property("naturalWidth", 0)
    first = image.get_attribute("src") or ""
    expect(image).not_to_have_attribute("src", first)
    page.get_by_role("button", name="K2 show large").click()
    expect(page.locator("#preview")).to_have_class(re.compile("single"))
    page.goto(f"{panel.url}/#/log")
    expect(image).not_to_have_attribute("src", PICTURE)
    pictures = panel.server.config.app.state.streams.pictures  # type: ignore[union-attr]
    wait_until(lambda: pictures.open == 0, "nobody waits for a picture")
    page.goto(f"{panel.url}/#/live")
    expect(image).to_have_attribute("src", PICTURE)
    page.evaluate(HIDE)
    expect(image).not_to_have_attribute("src", PICTURE)
    wait_until(lambda: pictures.open == 0, "nobody waits for a picture")


def test_the_rig_view_has_cameras_and_processes_also_when_it_is_opened_first(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig_is_shown = threading.Event()
    monkeypatch.setattr(service, "status", lambda: (rig_is_shown.wait(20), MemoryService.status(service))[1])
    page = open_page(f"{panel.url}/#/rig")
    expect(page.locator("#rig-name")).to_have_text("memory")
    rig_is_shown.set()
    expect(page.locator("#rig-facts")).to_contain_text("K1")
    expect(page.locator("#rig-facts")).to_contain_text("recorder")
