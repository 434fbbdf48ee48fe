"""A training through the page: the real service, simulated GigE Vision cameras, Debian's Chromium."""

import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from recorder.checking.verify import verify
from recorder.reading.info import info
from rig.clocks import host_now
from rig.settings.file import CONFIG
from simrig.programs.simulated_hill import SimulatedHill
from tests.browser.conftest import Open
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback

RATE_HZ = 30.0


@contextmanager
def hill_and_service(folder: Path, loopback: Loopback) -> Iterator[tuple[SimulatedHill, Serving]]:
    """Cameras that the test holds in its hands, and a service that takes them for real ones."""
    rig = write_rig(folder, "aravis", loopback)
    text = rig.read_text()
    rig.write_text(re.sub(r"\[simulation\]\nscenario = .*\n", "", text))
    names = ("K1", "K2", "K3")
    addresses = dict(zip(names, loopback.cameras(3), strict=True))
    scenario = CONFIG / "scenarios" / "training.toml"
    with (
        SimulatedHill(scenario, addresses, RATE_HZ, epoch=host_now()) as hill,
        serving(folder, rig, loopback) as service,
    ):
        yield hill, service


@pytest.fixture
def training(tmp_path: Path, loopback: Loopback) -> Iterator[Serving]:
    """A service with simulated GigE Vision cameras that all work."""
    with hill_and_service(tmp_path, loopback) as (_, service):
        yield service


def press(page: Page, name: str) -> None:
    """Press a button by its words."""
    page.get_by_role("button", name=name, exact=True).click()


def await_state(page: Page, word: str) -> None:
    """Wait until the big state says so."""
    expect(page.locator("#state-word")).to_have_text(word)


def await_kept(page: Page) -> None:
    """Wait until the page offers to save what has happened: pulses are arriving."""
    expect(page.locator("#save-last")).to_be_enabled()


def await_image(image: Locator) -> None:
    """Wait until an image is there."""
    expect(image).to_have_js_property("complete", True)
    expect(image).not_to_have_js_property("naturalWidth", 0)


def arm(page: Page) -> None:
    """Arm, and wait for pulses."""
    press(page, "Arm")
    await_state(page, "Armed")
    await_kept(page)


def stop(page: Page) -> None:
    """Hold the button until the recording ends: in its first seconds a tap is not enough."""
    button = page.locator("#next-step[data-step=recording]")
    expect(button).to_be_enabled()
    button.hover()
    page.mouse.down()
    await_state(page, "Armed")
    page.mouse.up()


def record(page: Page, seconds: int = 1) -> None:
    """Record so long on the page's own clock, and stop."""
    page.locator("#next-step[data-step=armed]").click()
    await_state(page, "Recording")
    expect(page.locator("#state-time")).to_have_text(re.compile(rf"0:0[{seconds}-9]"))
    stop(page)


def test_a_jump_from_arming_to_the_verified_file(training: Serving, open_page: Open, tmp_path: Path) -> None:
    page = open_page(training.url)
    await_state(page, "Idle")
    page.get_by_role("textbox", name="Bib").fill("17")
    page.get_by_role("textbox", name="Athlete").fill("Anna Øverbø")
    page.get_by_role("textbox", name="Gate").fill("12")
    arm(page)
    await_image(page.locator("#preview img"))
    expect(page.locator("#cameras")).to_contain_text("K2Ready")
    record(page)
    page.get_by_role("button", name="Look at it").click()
    expect(page.get_by_role("heading", level=1, name="17 · Anna Øverbø")).to_be_visible()
    (listed,) = training.get("/api/recordings")  # on a busy machine simulated cameras may lose frames, and so it says
    expect(page.locator("#recording-verdict")).to_contain_text(listed["verdict"]["text"])
    assert listed["verdict"]["text"].startswith("Complete: all") == (listed["counts"]["partial"] == 0)

    frame, where = page.locator("#frames img:not(.ghost)"), page.locator("#frame-where")
    expect(where).to_contain_text(" / ")  # where most moves, if something does
    page.keyboard.press("Home")
    expect(where).to_contain_text(re.compile(r"^1 / "))
    await_image(frame)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    expect(where).to_contain_text(re.compile(r"^12 / "))
    expect(frame).to_have_attribute("src", re.compile(r"/pulses/12\.jpg$"))
    page.locator("#frame-slider").fill("4")
    expect(where).to_contain_text(re.compile(r"^5 / "))
    expect(frame).to_have_attribute("src", re.compile(r"/pulses/5\.jpg$"))
    await_image(frame)
    page.get_by_role("button", name="K3", exact=True).click()
    expect(page.locator("#frames .block:visible")).to_have_count(1)

    page.locator("#recording-session").get_by_label("Wind").fill("0.5 m/s")
    page.keyboard.press("Tab")
    expect(page.locator("#snacks")).to_contain_text("Saved.")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download").click()
    copy = tmp_path / "downloaded.mcap"
    download.value.save_as(copy)
    report = verify(copy)
    assert report.recounted.agrees
    assert not report.damaged
    assert report.verdict == ("partial" if listed["counts"]["partial"] else "clean")
    found = info(copy)
    assert (found.session["athlete"], found.session["bib"], found.session["gate"]) == ("Anna Øverbø", "17", "12")
    (kept,) = training.get("/api/recordings")
    assert kept["session"]["wind"] == "0.5 m/s"
    counts = kept["counts"]
    assert counts["pulses"] == counts["complete"] + counts["partial"] > 30, "one second, and what was kept before it"


@pytest.mark.long
def test_a_deleted_jump_comes_back(training: Serving, open_page: Open) -> None:
    page = open_page(training.url)
    page.get_by_role("textbox", name="Bib").fill("3")
    arm(page)
    page.locator("#save-last").click()
    expect(page.locator("#snacks")).to_contain_text("Saved 3.")
    await_image(page.locator("#last-recording img"))

    page.goto(f"{training.url}/#/recordings")
    page.get_by_role("link", name=re.compile("^3 ")).click()
    for undo in (True, False):
        press(page, "Delete")
        expect(page.locator("#recordings-empty")).to_be_visible()
        expect(page.locator("#recordings-empty")).to_have_text("No jumps recorded yet.")
        assert training.get("/api/recordings") == []
        if undo:
            press(page, "Undo")
            page.get_by_role("link", name=re.compile("^3 ")).click()
    page.get_by_role("button", name="Close").first.click()
    page.goto(f"{training.url}/#/trash")
    press(page, "Restore")
    expect(page.locator("#recordings-empty")).to_be_visible()
    expect(page.locator("#recordings-empty")).to_have_text("The trash is empty.")
    (back,) = training.get("/api/recordings")
    assert back["session"]["bib"] == "3"


@pytest.mark.long
def test_two_pages_show_the_same(training: Serving, open_page: Open) -> None:
    first, second = open_page(training.url), open_page(training.url, width=360, height=780)
    arm(first)
    await_state(second, "Armed")
    second.locator("#next-step").click()
    await_state(first, "Recording")
    expect(first.locator("#save-last")).to_be_hidden()
    expect(first.locator("#disarm")).to_be_hidden()
    stop(first)
    await_state(second, "Armed")
    expect(second.locator("#last-recording")).to_contain_text(re.compile("Complete: all|lack a frame"))
    assert len(training.get("/api/recordings")) == 1


@pytest.mark.long
def test_a_dead_camera_is_named_with_what_to_do(tmp_path: Path, loopback: Loopback, open_page: Open) -> None:
    with hill_and_service(tmp_path, loopback) as (hill, service):
        page = open_page(service.url)
        arm(page)
        page.locator("#next-step").click()
        await_state(page, "Recording")
        hill.kill("K2")
        card = page.locator("#cameras > li").nth(1)
        expect(card).to_contain_text(re.compile("Silent|Absent"))
        expect(card.locator(".advice")).to_contain_text("check its")
        expect(page.locator("#preview .block").nth(1).locator(".cover strong")).to_have_text(
            re.compile("Silent|Absent")
        )
        expect(page.locator("#preview .block").nth(0).locator(".cover")).to_be_hidden()
        expect(page.locator("#state-text")).to_contain_text("2 of 3 cameras: without K2")
        hill.restart("K2")
        expect(card).to_contain_text("Ready")
        stop(page)
        page.get_by_role("button", name="Look at it").click()
        expect(page.locator("#recording-verdict")).to_contain_text(
            re.compile(r"pulses lack a frame: .*K2 (\d+ damaged, )?\d+ (lost|absent)")
        )
        _go_to_gap(page, re.compile(r"K1 whole.*K2 (lost|absent).*K3 whole"))
        expect(page.locator("#frames .block").nth(1).locator(".cover")).to_be_visible()
        page.goto(f"{service.url}/#/log")
        expect(page.locator("#log-list")).to_contain_text("K2")


def _go_to_gap(page: Page, fates: re.Pattern[str]) -> None:
    """Press "Next gap" until the frames have these fates: a busy machine may have lost others before."""
    expect(page.locator("#frame-where")).not_to_be_empty()
    for _ in range(50):
        press(page, "Next gap")
        if fates.search(page.locator("#frame-fate").inner_text()):
            return
    raise AssertionError(f"no gap with {fates.pattern}")


@pytest.mark.long
def test_a_lost_connection_is_said_and_comes_back(tmp_path: Path, loopback: Loopback, open_page: Open) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback) as service:
        page = open_page(service.url)
        await_state(page, "Idle")
        expect(page.locator("#banner")).to_be_hidden()
        service.signal(signal.SIGTERM)
        expect(page.locator("#banner")).to_contain_text("Connection lost.")
        expect(page.locator("#next-step")).to_be_disabled()
        expect(page.locator("#action-reason")).to_contain_text("No connection")
        expect(page.locator("#state-time")).to_contain_text("as of")
    port = int(service.url.rpartition(":")[2])
    with serving(tmp_path, rig, loopback, port=port):
        expect(page.locator("#banner")).to_be_hidden()
        expect(page.locator("#next-step")).to_be_enabled()


@pytest.mark.long
def test_a_whole_jump_by_keys_alone(training: Serving, open_page: Open) -> None:
    page = open_page(training.url)
    await_state(page, "Idle")
    expect(page.locator("#next-step")).to_be_enabled()
    page.keyboard.press("r")
    await_state(page, "Armed")
    await_kept(page)
    page.keyboard.press("n")
    page.keyboard.type("42")
    page.keyboard.press("Tab")
    page.keyboard.type("Rune r s")  # letters in a field are no commands
    page.keyboard.press("Escape")
    await_state(page, "Armed")
    page.keyboard.press("r")
    await_state(page, "Recording")
    expect(page.locator("#next-step[data-step=recording]")).to_be_enabled()  # no longer busy with the start
    expect(page.locator("#next-step small")).to_have_text("")  # no longer guarded against a second press
    page.keyboard.press("r")
    await_state(page, "Armed")
    expect(page.locator("#last-recording")).to_contain_text("42 · Rune r s")
    page.keyboard.press("j")
    expect(page.locator("#recordings-list a.summary")).to_have_count(1)
    page.locator("#recordings-list a.summary").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#frame-where")).to_contain_text(" / ")
    page.keyboard.press("Home")
    expect(page.locator("#frame-where")).to_contain_text(re.compile(r"^1 / "))
    page.keyboard.press("End")
    page.keyboard.press("3")
    expect(page.locator("#frames")).to_have_class(re.compile("single"))
    page.keyboard.press("Delete")
    expect(page.locator("#recordings-empty")).to_be_visible()
    page.keyboard.press("v")
    await_state(page, "Armed")
    expect(page.locator("#disarm:enabled")).to_be_visible()
    page.keyboard.press("x")
    await_state(page, "Idle")
