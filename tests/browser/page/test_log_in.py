"""Tokens, and what those may do who have them."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from rig.api.status import State
from tests.browser.conftest import Open
from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access

TOKEN = "a-token-of-more-than-sixteen-characters"  # noqa: S105 - of this test alone


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
        expect(page.locator("#recording-buttons a.primary")).to_be_visible()
        expect(page.locator("#recording-digitize")).to_be_visible()
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
