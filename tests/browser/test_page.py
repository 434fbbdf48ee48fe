"""The page itself, over a rig in memory: languages, sizes, looks, accessibility, refusals, login."""

import json
import re
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from rig.api.jump import LastJump, MeasuredValue
from rig.api.recordings import Recording, RecordingOrder
from rig.api.statement import Level, Statement
from rig.api.status import AutomaticStatus, State, Status
from rig.errors import StateForbidsError, StorageError
from rig.frame import FrameStatus
from rig.phrase import phrase, plain
from service.status.statements import recording_ended
from tests.browser.conftest import Open
from tests.recorder.logs import ALL_OK
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access

AXE = Path(__file__).with_name("npm") / "node_modules" / "axe-core" / "axe.min.js"
TOKEN = "a-token-of-more-than-sixteen-characters"  # noqa: S105 - of this test alone
#: The views, and what is there when a view has what it shows.
READY = {
    "live": "#cameras li",
    "recordings": "#recordings-list li",
    "trash": "#recordings-empty",
    "recordings/jump-2": "#frame-slider",
    "log": "#log-list li, #log-empty",
    "doctor": "#doctor-run",
    "aim": "#aim-cameras button",
    "rig": "#rig-facts div",
}
SMALLEST_TOUCH_PX = 44
#: What a finger has to hit, and fails to have room for it.
TOO_SMALL = """least =>
    [...document.querySelectorAll("button, select, textarea, input:not([type=checkbox]), nav a, .button")]
    .filter(e => e.checkVisibility() && !e.matches(".block"))
    .filter(e => Math.min(e.getBoundingClientRect().height, e.getBoundingClientRect().width) < least)
    .map(e => e.outerHTML)"""
PICTURE = re.compile("^blob:")
HIDE = (
    "Object.defineProperty(document, 'hidden', { value: true }); document.dispatchEvent(new Event('visibilitychange'))"
)


@pytest.fixture
def jumps(service: MemoryService) -> None:
    """Two recordings, one with a lost frame."""
    folder = service.catalogue.directory
    write_recording(folder, "jump-1", (ALL_OK,) * 30, {"athlete": "Anna Berg", "bib": "17"})
    lost = (FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK)
    write_recording(folder, "jump-2", (lost, *(ALL_OK,) * 29), {"athlete": "Ola <b>Nordmann</b>", "bib": "4"})


def enter(page: Page, panel: Panel, view: str) -> None:
    """Go to a view, and wait until it has what it shows."""
    page.goto(f"{panel.url}/#/{view}")
    expect(page.locator(f":is({READY[view]}):visible").first).to_be_attached()
    if view == "doctor":
        page.locator("#doctor-run").click()
        expect(page.locator(".finding")).to_have_count(2)


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
    why = "only 3 of 17 pulses show both skis in flight (all points in 32 of 35 pulses in sight)"
    service.last_jump = LastJump(
        recording="jump-1", jump=1, time=datetime(2026, 2, 14, 10, 15, 30, tzinfo=UTC), ok=False, verdict=why, **values
    )
    service._become(State.ARMED)
    figures = page.locator("#measured-figures > div")
    expect(figures).to_have_text(
        [
            "Take-off speed26.10\u202f±\u202f0.02\u202fm/s",
            "Perpendicular to the table2.1\u202f±\u202f0.1\u202fm/s",
            "Speed at 20 m25.489\u202f±\u202f0.004\u202fm/s",
            "Angle of attack, 0.5 s19.5\u202f±\u202f0.5\u202f°",
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
        "Fart på kanten26,10\u202f±\u202f0,02\u202fm/s"
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


def test_names_of_athletes_are_text_and_nothing_else(panel: Panel, jumps: None, open_page: Open) -> None:
    page = open_page(panel.url)
    enter(page, panel, "recordings")
    expect(page.locator("#recordings-list")).to_contain_text("Ola <b>Nordmann</b>")
    page.get_by_role("searchbox").fill("anna")
    expect(page.locator("#recordings-list li")).to_have_count(1)


def test_the_focus_stays_on_a_recording_when_the_list_is_drawn_anew(
    panel: Panel, client: httpx.Client, jumps: None, open_page: Open
) -> None:
    page = open_page(panel.url)
    enter(page, panel, "recordings")
    link = page.get_by_role("link", name=re.compile("^17 "))
    link.focus()
    client.patch("/api/recordings/jump-1", json={"bib": "18"}).raise_for_status()
    link = page.get_by_role("link", name=re.compile("^18 "))
    expect(link).to_be_focused()


def test_who_jumps_is_taken_at_the_start_and_conditions_carry_over(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(panel.url)
    page.get_by_role("textbox", name="Bib").fill("7")
    page.get_by_role("textbox", name="Wind").fill("1 m/s")
    page.locator("#next-step").click()
    expect(page.locator("#jumping")).to_have_text("Being recorded: 7")
    expect(page.get_by_role("textbox", name="Bib")).to_have_value("")
    page.get_by_role("textbox", name="Bib").fill("8")
    page.get_by_role("textbox", name="Notes").fill("long")
    page.reload()
    expect(page.get_by_role("textbox", name="Bib")).to_have_value("8")
    expect(page.locator("#next-step small")).to_have_text("")
    page.locator("#next-step").click()
    expect(page.locator("#next-step small")).to_have_text("8")
    expect(page.get_by_role("textbox", name="Wind")).to_have_value("1 m/s")
    (saved,) = service.catalogue.entries()
    assert (saved.session["bib"], saved.session["wind"], saved.session["notes"]) == ("7", "1 m/s", "")
    page.get_by_role("button", name="Somebody else").click()
    expect(page.get_by_role("textbox", name="Bib")).to_be_focused()
    expect(page.get_by_role("textbox", name="Bib")).to_have_value("")


def test_what_is_typed_while_a_jumper_begins_is_never_the_next_ones(
    panel: Panel, service: MemoryService, client: httpx.Client, open_page: Open
) -> None:
    """Two devices: one types about a jumper, the other one records him."""
    service.arm()
    service.jumpers.import_table(b"bib;athlete\n1;Anna\n2;Berit\n3;Cecilie\n")
    page = open_page(panel.url)
    athlete = page.get_by_role("textbox", name="Athlete", exact=True).first
    expect(athlete).to_have_value("Anna")
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/api/next-jumper", hold)
    with page.expect_request("**/api/next-jumper"):
        athlete.fill("Anna Marie")  # and is being sent
    made = service.start_recording(RecordingOrder())
    expect(page.locator("#jumping")).to_have_text("Being recorded: 1 \N{MIDDLE DOT} Anna")
    held[0].continue_()
    page.unroute("**/api/next-jumper")
    snack = page.locator("#snacks")
    expect(snack).to_contain_text("1 \N{MIDDLE DOT} Anna began to jump while this was written: Anna Marie")
    expect(page.get_by_role("textbox", name="Bib").first).to_have_value("2")
    expect(athlete).to_have_value("Berit")
    snack.get_by_role("button", name="Write it into his jump").click()
    expect(page.locator("#jumping")).to_contain_text("Anna Marie")

    # While somebody types, the others' edits reach all fields but his, and of one field the last edit counts.
    athlete.focus()
    page.keyboard.type("x")
    client.patch("/api/next-jumper", json={"gate": "9"}).raise_for_status()
    expect(page.get_by_role("textbox", name="Gate")).to_have_value("9")
    expect(athlete).to_have_value("Beritx")
    wait_until(lambda: service.jumpers.view().next.session.athlete == "Beritx", "it is sent while he types", 10)
    client.patch("/api/next-jumper", json={"athlete": "Berit"}).raise_for_status()
    page.keyboard.press("Tab")
    expect(athlete).to_have_value("Berit")
    current = service.status().recording
    assert current is not None
    assert (current.id, current.session.athlete) == (made.id, "Anna Marie")


def test_a_start_list_on_two_phones(panel: Panel, service: MemoryService, open_page: Open, tmp_path: Path) -> None:
    table = tmp_path / "list.csv"
    table.write_bytes("Startnr;Navn;Klubb\r\n17;Åse Bjørk;Lyn\r\n18;Berit;\r\n19;Cecilie;\r\n".encode("cp1252"))
    first = open_page(panel.url, width=360, height=780, has_touch=True, is_mobile=True)
    second = open_page(panel.url, width=360, height=780, locale="nb-NO", has_touch=True, is_mobile=True)
    first.get_by_role("button", name="Edit").tap()
    (tmp_path / "wrong.csv").write_text("bib;athlete;recording\n1;A;B\n")
    first.locator("#list-file").set_input_files(tmp_path / "wrong.csv")
    expect(first.get_by_role("alert")).to_contain_text('The list was not loaded. column "recording" has a name')
    first.locator("#list-file").set_input_files(table)
    following = second.locator("#list-rows [aria-current]")
    expect(following).to_contain_text("17Åse Bjørk")
    second.get_by_role("button", name="Hopp over").tap()
    expect(first.locator("#list-rows [aria-current]")).to_contain_text("18Berit")
    expect(first.locator("#list-undone")).to_have_text("17 Åse Bjørk was skipped")
    first.get_by_role("button", name="Undo").tap()
    expect(following).to_contain_text("17Åse Bjørk")
    second.locator("#list-rows button", has_text="Cecilie").tap()
    expect(first.get_by_role("textbox", name="Athlete", exact=True).first).to_have_value("Cecilie")
    first.get_by_role("button", name="Move Cecilie up").tap()
    expect(second.locator("#list-rows li")).to_contain_text(["17", "19", "18"])
    first.locator("#list-bib").fill("20")
    first.locator("#list-athlete").fill("Eva")
    first.get_by_role("button", name="Add").tap()
    expect(second.locator("#list-rows li")).to_have_count(4)
    first.get_by_role("button", name="Remove Eva").tap()
    expect(second.locator("#list-rows li")).to_have_count(3)
    for page in (first, second):
        assert not page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX)
        assert page.evaluate("document.documentElement.scrollWidth") == 360


def test_a_second_tap_is_said_beside_the_button_and_a_long_press_stops(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(panel.url)
    button = page.locator("#next-step")
    expect(button).to_be_enabled()
    button.click()
    expect(button).to_have_text("Stophold to stop")
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


def test_a_long_press_stops_at_any_time_wherever_the_button_goes_and_its_end_is_no_tap(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(panel.url)
    button = page.locator("#next-step")
    expect(button).to_be_enabled()
    button.click()
    expect(button).to_have_text("Stophold to stop")
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
    wait_until(lambda: pictures.open == 0, "nobody waits for a picture", 20)
    page.goto(f"{panel.url}/#/live")
    expect(image).to_have_attribute("src", PICTURE)
    page.evaluate(HIDE)
    expect(image).not_to_have_attribute("src", PICTURE)
    wait_until(lambda: pictures.open == 0, "nobody waits for a picture", 20)


def test_norwegian_from_the_browser_and_by_choice(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open
) -> None:
    page = open_page(panel.url, locale="nb-NO")
    expect(page.locator("#state-word")).to_have_text("Av")
    expect(page.locator("#state-text")).to_contain_text("Kameraene er av.")
    expect(page.locator("html")).to_have_attribute("lang", "nb")
    enter(page, panel, "recordings/jump-2")
    expect(page.locator("#recording-verdict")).to_have_text("1 av 30 pulser mangler et bilde")
    expect(page.locator("#frame-fate")).to_contain_text("K2 tapt")
    page.keyboard.press("?")
    page.get_by_label("Språk").select_option("en")
    expect(page.get_by_role("heading", name="Settings and keys")).to_be_visible()
    page.get_by_role("button", name="Close").click()
    expect(page.locator("#frame-fate")).to_contain_text("K2 lost")
    expect(page.locator("#recording-verdict")).to_contain_text("1 of 30 pulses lack a frame")
    page.reload()
    expect(page.locator("html")).to_have_attribute("lang", "en")


def test_check_log_and_reasons_are_said_in_the_language_chosen(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    full = phrase("disk_full", "the disk is full: make room on it or record to another one")
    service.tell("warning", "disk", phrase("event_there_neither", "there neither: {why}", why=full))
    service.tell("info", "K1", plain("as the library says it"))
    page = open_page(f"{panel.url}/#/log", locale="nb-NO")
    told = page.locator("#log-list li", has_text="ikke der heller")
    expect(told).to_contain_text("advarsel")
    expect(told).to_contain_text("ikke der heller: disken er full: skaff plass på den, eller ta opp på en annen")
    expect(page.locator("#log-list li", has_text="K1")).to_contain_text("as the library says it")
    enter(page, panel, "doctor")
    first, second = page.locator(".finding").all()
    expect(first).to_contain_text("ADVARSEL nettverk")
    expect(first).to_contain_text("K1 gjennom enp2s0: MTU 1500, men ikke alle kameraene er i subnettet 10.0.0.0/24")
    expect(first.locator(".advice")).to_have_text("gi nettverksporten en adresse i kameraets subnett")
    expect(second).to_contain_text("fast enough")
    reason = StorageError(phrase("why_deleted", "{path}: was deleted", path="/data/jump.mcap"))
    service.notice = recording_ended("jump", reason)
    service.arm()
    enter(page, panel, "live")
    expect(page.locator("#state-notice")).to_contain_text(
        "Opptaket jump tok slutt for tidlig: /data/jump.mcap: ble slettet under opptaket"
    )


@pytest.mark.parametrize("locale", ["en-GB", "nb-NO"])
def test_a_narrow_phone_scrolls_down_only_and_takes_gloves(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, locale: str
) -> None:
    service.arm()
    page = open_page(panel.url, width=360, height=780, locale=locale, has_touch=True, is_mobile=True)
    for view in READY:
        enter(page, panel, view)
        assert page.evaluate("document.documentElement.scrollWidth") == 360, view
        assert not page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX), view


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


def _grave(page: Page) -> list[str]:
    found: dict[str, Any] = page.evaluate("axe.run({ resultTypes: ['violations'] })")
    return [
        f"{violation['id']}: {violation['help']}: {json.dumps([node['html'][:150] for node in violation['nodes'][:3]])}"
        for violation in found["violations"]
        if violation["impact"] in {"serious", "critical"}
    ]


def test_looking_through_a_jump(panel: Panel, jumps: None, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    where, frames = page.locator("#frame-where"), page.locator("#frames")
    expect(where).to_have_text(re.compile("^1 / 30"))
    expect(page.locator("#frames .block").nth(1).locator(".cover")).to_contain_text("lost")
    speed = page.locator("#frame-speed")
    speed.select_option(label="1/10")  # at full speed a crowded machine may see the end of this second only
    page.get_by_role("button", name="Play").click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.get_by_role("button", name="Pause").click()
    speed.select_option(label="Full speed")
    page.locator("#frame-where").click()
    page.keyboard.press("Space")
    expect(where).to_have_text(re.compile("^30 / 30"))
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    page.keyboard.press("g")
    expect(where).to_have_text(re.compile("^1 / 30"))
    strip = page.locator(".strip-lines").bounding_box()
    assert strip is not None
    page.mouse.click(strip["x"] + strip["width"] * 0.55, strip["y"] + 5)
    expect(where).to_have_text(re.compile("^17 / 30"))

    page.get_by_role("button", name="Enlarge", exact=True).click()
    expect(frames).to_have_class(re.compile("zoomed"))
    box = frames.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 300, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 80, steps=5)
    page.mouse.up()
    expect(frames).not_to_have_class(re.compile("single"))
    page.mouse.click(box["x"] + 300, box["y"] + 100)
    expect(frames).to_have_class(re.compile("single"))
    expect(frames).not_to_have_class(re.compile("zoomed"))


def test_a_jump_that_runs_can_be_looked_at_once_it_is_stopped(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    started = service.start_recording(RecordingOrder(bib="5"))
    page = open_page(f"{panel.url}/#/recordings/{started.id}")
    expect(page.locator("#recording-verdict")).to_contain_text("is being recorded")
    expect(page.locator("#player")).to_be_hidden()
    service.stop_recording(started.id)
    expect(page.locator("#frame-strip li")).to_have_count(1)
    expect(page.locator("#recording-verdict")).to_contain_text("Complete")


@pytest.mark.parametrize(
    ("look", "width"), [("light", 360), ("light", 1280), ("dark", 360), ("dark", 1280), ("outdoor", 360)]
)
def test_axe_finds_nothing_grave(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, look: str, width: int
) -> None:
    if not AXE.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {AXE.parents[2]}, or `make test`")
    page = open_page(
        panel.url, width=width, color_scheme="light" if look == "outdoor" else look, reduced_motion="reduce"
    )
    page.evaluate("look => localStorage.setItem('svev.look', JSON.stringify(look))", look)
    page.reload()
    page.evaluate(AXE.read_text())
    for view in READY:
        enter(page, panel, view)
        assert not _grave(page), view
    page.goto(f"{panel.url}/#/live")
    for state in (State.ARMING, State.ARMED, State.RECORDING, State.DISARMING, State.FAULT):
        service._become(state)
        expect(page.locator("#state")).to_have_attribute("data-state", state.value)
        assert not _grave(page), state
    page.locator("#open-settings").click()
    assert not _grave(page), "settings"


@pytest.fixture
def guarded(service: MemoryService, loopback: Loopback) -> Iterator[Panel]:
    """A panel that wants its token."""
    with serving(service, Access.for_address(loopback.host, environment={"SVEV_TOKEN": TOKEN})) as running:
        yield running


def test_who_may_only_watch_has_no_buttons_and_can_log_out(
    service: MemoryService, loopback: Loopback, open_page: Open, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("tokens") / "tokens"
    file.write_text("watch a-token-to-watch-with\noperate a-token-to-operate-with\n")
    write_recording(service.catalogue.directory, "jump")
    with serving(service, Access.for_address(loopback.host, file)) as panel:
        page = open_page(panel.url)
        page.locator("#login-token").fill("a-token-to-watch-with")
        page.locator("#login-submit").click()
        expect(page.locator(".only-watching")).to_be_visible()
        expect(page.locator("#next-step")).to_be_hidden()
        page.keyboard.press("r")
        page.locator("#open-settings").click()
        expect(page.locator("#role-words")).to_contain_text("You may watch")
        page.locator("#logout").click()
        page.locator("#login-token").fill("a-token-to-operate-with")
        page.locator("#login-submit").click()
        expect(page.locator("#next-step")).to_be_enabled()
        expect(page.locator(".only-watching")).to_be_hidden()
        page.goto(f"{panel.url}/#/recordings/jump")
        expect(page.locator("#recording-buttons a")).to_be_visible()
        expect(page.locator("#recording-buttons button")).to_be_hidden()
    assert service.state is State.IDLE


def test_the_token_is_asked_for_once(guarded: Panel, open_page: Open) -> None:
    page = open_page(guarded.url)
    dialog = page.get_by_role("dialog", name="Log in")
    expect(dialog).to_be_visible()
    for _ in range(3):
        page.keyboard.press("Escape")
    expect(dialog).to_be_visible()
    dialog.get_by_label("Token").fill("wrong")
    dialog.get_by_role("button").click()
    expect(dialog.get_by_role("alert")).to_contain_text("the token is wrong")
    dialog.get_by_label("Token").fill(TOKEN)
    dialog.get_by_role("button").click()
    expect(page.locator("#state-word")).to_have_text("Idle")
    expect(dialog).to_be_hidden()
    page.reload()
    expect(page.locator("#state-word")).to_have_text("Idle")
    assert TOKEN not in page.url
    assert TOKEN not in page.evaluate("JSON.stringify({ ...localStorage }) + document.cookie")
