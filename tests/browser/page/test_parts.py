"""What a page loads, when, and what it says when a part of it does not come."""

from playwright.sync_api import Page, Route, expect

from tests.browser.conftest import Open
from tests.webpanel.serving import Panel

#: So many files the live view takes at most, documents, drawings, worker and all.
LIVE_MOST = 65


def _files(page: Page) -> list[str]:
    """From now on: paths of the files of the page that are asked for, without the version."""
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url) if "/page/" in request.url else None)
    return asked


def test_a_view_is_loaded_when_it_is_shown_and_kept(panel: Panel, open_page: Open) -> None:
    page = open_page("about:blank")
    asked = _files(page)
    page.goto(panel.url)
    expect(page.locator("#cameras li").first).to_be_visible()
    rooms = {url.split("/")[5] for url in asked}
    assert 20 < len(asked) <= LIVE_MOST
    assert rooms.isdisjoint({"system", "viewing", "athletes", "digitize"})
    assert not [url for url in asked if "/i18n/nb" in url]

    asked.clear()
    page.locator(".nav a[href='#/log']").click()
    expect(page.locator("#log")).to_be_visible()
    assert {"log.js", "system.css", "en-log.js"} == {url.rpartition("/")[2] for url in asked}
    expect(page.locator("#log h1")).to_have_text("Log")
    asked.clear()
    page.locator(".nav a[href='#/live']").click()
    page.locator(".nav a[href='#/log']").click()
    expect(page.locator("#log")).to_be_visible()
    page.keyboard.press("v")
    expect(page.locator("#live")).to_be_visible()
    assert not asked


def test_a_part_that_does_not_come_says_so_and_can_be_tried_again(panel: Panel, open_page: Open) -> None:
    page = open_page(panel.url, locale="nb-NO")
    expect(page.locator("#cameras li").first).to_be_visible()
    cut = True

    def refuse(route: Route) -> None:
        if cut or "/parts/" in route.request.url:
            route.abort()
        else:
            route.fallback()

    page.route("**/page/*/system/**", refuse)
    page.route("**/page/*/parts/**", refuse)
    page.route(f"{panel.url}/", refuse)
    page.locator(".nav a[href='#/rig']").click()
    expect(page.locator("#loading-title")).to_have_text("Denne siden kan ikke vises.")
    expect(page.locator("#loading-why")).to_contain_text("Ingen forbindelse med tjenesten")
    expect(page.locator("#pill")).to_be_visible()  # what else is on the page goes on
    page.locator("#loading-again").click()
    expect(page.locator("#loading-again")).to_be_enabled()
    expect(page.locator("#loading-why")).to_contain_text("Ingen forbindelse med tjenesten")

    # The rest of the page works meanwhile; a service that answers and has no such file is another one.
    page.keyboard.press("v")
    expect(page.locator("#live")).to_be_visible()
    cut = False
    page.keyboard.press("i")
    expect(page.locator("#loading-why")).to_have_text("Tjenesten er startet på nytt med en annen utgave av siden.")
    page.unroute_all()
    page.locator("#loading-again").click()
    expect(page.locator("#rig-file")).to_be_visible()
    expect(page.locator("#loading")).to_be_hidden()


def test_a_language_that_does_not_come_leaves_the_page_as_it_was(panel: Panel, open_page: Open) -> None:
    page = open_page(panel.url)
    expect(page.locator("#cameras li").first).to_be_visible()
    page.route("**/i18n/nb*", lambda route: route.abort())
    page.locator("#open-settings").click()
    page.locator("#language").select_option("nb")
    expect(page.locator(".snack")).to_contain_text("no connection to the service")
    expect(page.locator("#language")).to_have_value("en")
    expect(page.locator("#settings-title")).to_have_text("Settings and keys")
    page.unroute_all()
    page.locator("#language").select_option("nb")
    expect(page.locator("#settings-title")).to_have_text("Innstillinger og taster")
    expect(page.locator("#vitals dt").first).to_have_text("Pulser")
