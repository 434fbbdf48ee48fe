"""One connection for all tabs of a browser: commands are not kept waiting by what the tabs watch."""

import re

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from service.supervision import tap_guard
from tests.browser.conftest import Open
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access
from webpanel.door.streams import OpenStreams

TABS = 7  # a browser opens six connections to a host
SHOWN = """shown => {
    Object.defineProperty(document, 'hidden', { value: !shown, configurable: true });
    document.dispatchEvent(new Event('visibilitychange'));
}"""
TOKEN = "a-token-of-more-than-sixteen-characters"  # noqa: S105 - of this test alone
NO_WORKER = "delete globalThis.SharedWorker"


def tabs_of(context: BrowserContext, panel: Panel, count: int) -> list[Page]:
    """Tabs in one browser that all show the live view; a browser without a window takes all of them for visible."""
    pages = [context.new_page() for _ in range(count)]
    for page in pages:
        page.goto(panel.url)
        expect(page.locator("#state-word")).to_have_text("Armed")
    return pages


def open_streams(panel: Panel) -> OpenStreams:
    """What the panel sends at present."""
    streams = panel.server.config.app.state.streams  # type: ignore[union-attr]
    assert isinstance(streams, OpenStreams)
    return streams


def await_picture(page: Page) -> str:
    """Wait until a picture is shown; returns its address."""
    expect(page.locator("#preview img")).to_have_attribute("src", re.compile("^blob:"))
    expect(page.locator("#preview img")).not_to_have_js_property("naturalWidth", 0)
    return page.locator("#preview img").get_attribute("src") or ""


@pytest.mark.long
def test_commands_of_seven_tabs_do_not_wait(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOLD_S", "CONFIRM_S"):
        monkeypatch.setattr(tap_guard, name, 0.0)
    service.arm()
    pages = tabs_of(open_page("about:blank").context, panel, TABS)
    for page in pages:
        await_picture(page)
    assert open_streams(panel).events.open == 1
    recording, stopping = pages[-1], pages[1]
    recording.locator("#next-step[data-step=armed]").click()
    for page in pages:
        expect(page.locator("#state-word")).to_have_text("Recording")
    stopping.locator("#next-step[data-step=recording]").click()
    expect(recording.locator("#state-word")).to_have_text("Armed")
    assert len(service.catalogue.entries()) == 1


def test_no_picture_is_fetched_twice_but_who_comes_later_gets_the_last_one(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page("about:blank")
    page.add_init_script(NO_WORKER)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url) if "preview.jpg" in request.url else None)
    page.goto(panel.url)
    while len(asked) < 6:
        page.wait_for_event("request")
    assert len(set(asked)) == len(asked), "each asks for another picture than the one before"
    service.pulses_a_picture = 2**40  # no more of them come
    page.locator(".nav a[href='#/log']").click()
    expect(page.locator("#preview img")).not_to_have_attribute("src", re.compile("."))
    page.locator(".nav a[href='#/live']").click()
    await_picture(page)


def test_without_shared_workers_a_hidden_tab_gives_its_connections_back(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page("about:blank")
    page.add_init_script(NO_WORKER)
    page.goto(panel.url)
    await_picture(page)
    streams = open_streams(panel)
    page.evaluate(SHOWN, False)
    wait_until(lambda: streams.events.open == streams.pictures.open == 0, "the connections are given back")
    service.disarm()
    page.evaluate(SHOWN, True)
    expect(page.locator("#state-word")).to_have_text("Idle")
    expect(page.locator("#banner")).to_be_hidden()


def test_one_viewer_too_many_is_told_why_and_commands_all_the_same(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    streams = open_streams(panel)
    monkeypatch.setattr(streams.events, "_most", 0)
    monkeypatch.setattr(streams.pictures, "_most", 0)
    page = open_page(panel.url, width=360, height=780)
    expect(page.locator("#banner")).to_contain_text("which is the most: close some")
    page.locator("#next-step").click()
    expect(page.locator("#state-word")).to_have_text("Armed")
    expect(page.locator("#preview-hint")).to_contain_text("which is the most: close some")
    service.disarm()
    expect(page.locator("#state-word")).to_have_text("Idle")
    expect(page.locator("body")).not_to_have_class(re.compile("stale"))
    monkeypatch.undo()
    expect(page.locator("#banner")).to_be_hidden()
    assert streams.events.open == 1


def test_who_logs_out_in_one_tab_sees_nothing_in_the_others(
    service: MemoryService, loopback: Loopback, open_page: Open
) -> None:
    access = Access.for_address(loopback.host, environment={"SVEV_TOKEN": TOKEN})
    with serving(service, access) as panel:
        first = open_page(panel.url)
        first.locator("#login-token").fill(TOKEN)
        first.locator("#login-submit").click()
        expect(first.locator("#state-word")).to_have_text("Idle")
        second = first.context.new_page()
        second.goto(panel.url)
        expect(second.locator("#state-word")).to_have_text("Idle")
        first.locator("#open-settings").click()
        first.locator("#logout").click()
        for page in (first, second):
            expect(page.locator("#login")).to_be_visible()
        expect(first.locator("#state-word")).to_have_text("Waiting")
        wait_until(lambda: open_streams(panel).events.open == 0, "the stream has ended")
