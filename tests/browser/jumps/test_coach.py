"""The coach's screen, and the athlete's page behind its code, in a network that phones reach."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from playwright.sync_api import Page, Request, expect

from rig.api.jump import MeasuredValue
from rig.api.recordings import RecordingOrder
from service.measuring.keeping import keep_result
from tests.browser.conftest import MEASURED, Open, write_kinogram
from tests.browser.views import AXE, BROKEN, assert_fits_a_phone
from tests.recorder.logs import ALL_OK
from tests.support.waiting import wait_until
from tests.webpanel.door.test_links import Clock
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access
from webpanel.door.links import Links
from webpanel.previews import to_jpeg

TOKEN = "a-token-of-more-than-sixteen-characters"  # noqa: S105 - of this test alone
#: A name that leads here (RFC 6761, 6.3) and that the service takes for a name in the network.
NAME = "hill.localhost"
HOUR_S = 3600.0
COUNT_LOCKS = """() => {
    globalThis.locks = 0;
    navigator.wakeLock.request = async () => { globalThis.locks += 1; return { released: false, release() {} }; };
}"""


@dataclass
class Hill:
    """A panel in a network that phones reach, and the clock of its links."""

    url: str
    clock: Clock
    panel: Panel

    def log_in(self, page: Page) -> None:
        """Give the token, once it is asked for."""
        page.locator("#login-token").fill(TOKEN)
        page.locator("#login-submit").click()
        expect(page.locator("#login")).to_be_hidden()


@pytest.fixture
def hill(service: MemoryService, jumps: None) -> Iterator[Hill]:
    """Two jumps, the last one measured."""
    access = Access.for_address("127.0.0.1", None, [NAME], {"SVEV_TOKEN": TOKEN}, proxies=["127.0.0.1"])
    clock = Clock()
    with serving(service, access, links=Links(b"s" * 32, access.tokens, HOUR_S, clock)) as panel:
        yield Hill(f"http://{NAME}:{panel.port}", clock, panel)


def _watched(page: Page) -> list[str]:
    """The paths that a page asks for from now on."""
    asked: list[str] = []

    def note(request: Request) -> None:
        asked.append(request.url.partition(NAME)[2].partition("/")[2])

    page.on("request", note)
    return asked


@pytest.mark.long
def test_the_screen_shows_the_last_jump_without_a_hand(hill: Hill, service: MemoryService, open_page: Open) -> None:
    service.arm()
    page = open_page("about:blank", width=1280, height=720)
    page.context.add_init_script(f"({COUNT_LOCKS})()")
    asked = _watched(page)
    page.goto(f"{hill.url}/#/coach")
    hill.log_in(page)
    expect(page.locator("#coach-who")).to_have_text("4 · Ola <b>Nordmann</b>")
    expect(page.locator("#coach-mark")).to_have_text("Measured well")
    expect(page.locator("#coach-figures b")).to_have_text(["94.0", "2.11", "91.8", "19.5°", "9.1°"])
    expect(page.locator("#coach-code")).to_have_attribute("src", re.compile("^blob:"))
    expect(page.locator("#coach-live-words")).to_have_text("1 s ago")
    expect(page.locator("#coach-live-image")).not_to_have_js_property("naturalWidth", 0)
    replay = page.locator("#coach-replay")
    expect(replay).to_have_attribute("data-stage", "ready")
    for _ in range(2):  # it goes on by itself
        expect(replay).not_to_have_attribute("data-pulse", replay.get_attribute("data-pulse") or "")
    assert page.locator("button:visible, a:visible, select:visible, input:visible").count() == 0
    assert page.evaluate("globalThis.locks") >= 1
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [1280, 720]

    started = service.start_recording(RecordingOrder(bib="5", preroll_s=0))
    expect(page.locator("#coach-state")).to_have_text("Recording")
    before = len(asked)
    expect(replay).not_to_have_attribute("data-pulse", replay.get_attribute("data-pulse") or "")
    assert not [path for path in asked[before:] if "/pulses/" in path]
    service.stop_recording(started.id)
    expect(page.locator("#coach-who")).to_have_text("5 · name unknown")
    wait_until(lambda: f"api/recordings/{started.id}/link" in asked, "the code of this jump is asked for")
    expect(page.locator("#coach-far")).to_have_text("Not measured")
    expect(page.locator("#coach-figures")).to_be_hidden()
    expect(replay).to_have_attribute("data-stage", "ready")

    service.last_jump = MEASURED.model_copy(update={"recording": started.id})
    service._wake()
    expect(page.locator("#coach-figures b").first).to_be_visible()
    expect(page.locator("#coach-code")).to_be_visible()
    page.route("**/link", lambda route: route.abort())
    started = service.start_recording(RecordingOrder(bib="6", preroll_s=0))
    service.stop_recording(started.id)
    expect(page.locator("#coach-who")).to_have_text("6 · name unknown")
    expect(page.locator("#coach-code")).to_be_hidden()  # no code of the jump before
    page.unroute("**/link")
    expect(page.locator("#coach-code")).to_be_visible()


def test_the_screen_says_that_the_connection_is_lost_and_comes_back(
    hill: Hill, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page(f"{hill.url}/#/coach", locale="nb-NO", width=768, height=1024, color_scheme="dark")
    hill.log_in(page)
    expect(page.locator("#coach-state")).to_have_text("Klar")
    expect(page.locator("#coach-replay")).to_have_attribute("data-stage", "ready")
    service.broken = RuntimeError("the network is gone")
    expect(page.locator("#coach-state")).to_have_text(re.compile("^Ingen forbindelse med Svev siden "))
    expect(page.locator("#coach-who")).to_have_text("4 · Ola <b>Nordmann</b>")
    expect(page.locator("#coach-live-words")).to_have_text("Direktebildet kommer om noen sekunder.")
    service.broken = None
    expect(page.locator("#coach-state")).to_have_text("Klar")
    expect(page.locator("#coach-live-words")).to_have_text("For 1 s siden")
    assert page.evaluate("document.documentElement.scrollWidth") == 768
    assert page.evaluate(BROKEN) == []


def test_a_link_shows_its_jump_and_nothing_else(hill: Hill, service: MemoryService, open_page: Open) -> None:
    service.arm()
    picture = service.catalogue.file("jump-2").with_name("jump-2.measured") / "kinogram.jpg"
    picture.write_bytes(to_jpeg(np.zeros((40, 100), np.uint8)))
    with hill.panel.client(headers={"Authorization": f"Bearer {TOKEN}", "Host": f"{NAME}:{hill.panel.port}"}) as coach:
        link = coach.get("/api/recordings/jump-2/link").json()["link"]
    page = open_page("about:blank", width=360, height=780, has_touch=True, is_mobile=True)
    asked = _watched(page)
    page.goto(link)
    expect(page.locator("#visit-who")).to_have_text("4 · Ola <b>Nordmann</b>")
    expect(page.locator("#visit-figures > div").first).to_contain_text("94.0\u202fkm/h")
    expect(page.locator("#visit-replay")).to_have_attribute("data-stage", "ready")
    other, canvas = page.locator("#visit-replay .replay-camera"), page.locator("#visit-replay canvas")
    for camera, width in (("K1", 160), ("K2", 160), ("K3", 160), ("All cameras", 480)):
        expect(other).to_have_text(camera)
        expect(canvas).to_have_js_property("width", width)
        other.click()
    expect(page.locator("#visit-until")).to_have_text(re.compile(r"^This page opens until .*, \d\d:\d\d\.$"))
    expect(page.locator("#visit-pictures img")).to_have_js_property("naturalWidth", 100)
    page.locator("#visit-more summary").click()
    assert_fits_a_phone(page)
    page.evaluate(AXE.read_text())
    assert page.evaluate("axe.run().then(found => found.violations.map(each => each.id))") == []
    with page.expect_popup() as opened:
        page.get_by_role("link", name="The coach's page").click()
    expect(opened.value.locator("h1")).to_have_text("For the coach")
    calls = {path for path in asked if path.startswith("api/")}
    assert calls
    assert all(path.startswith(("api/recordings/jump-2", "api/login/link")) for path in calls), calls
    assert page.locator("#login").is_hidden()

    page.goto(f"{hill.url}/#/jump/jump-1/{link.rpartition('/')[2]}")
    expect(page.locator("#visit-problem")).to_have_text(re.compile("^this link opens nothing, or no more"))
    expect(page.locator("#visit-jump")).to_be_hidden()
    hill.clock.now += HOUR_S + 60
    page.goto(f"{hill.url}/#/live")
    hill_login = page.locator("#login")
    expect(hill_login).to_be_visible()
    page.goto(link)
    page.reload()
    expect(page.locator("#visit-problem")).to_have_text("this link has ended: scan the code of the jump again")
    expect(page.locator("#visit-who")).to_have_text("Svev")


def test_of_a_recording_with_two_jumps_figures_and_pictures_are_of_one_jump(
    hill: Hill, service: MemoryService, open_page: Open
) -> None:
    for other in ("jump-1", "jump-2"):
        service.delete_recording(other)
    log = write_recording(service.catalogue.directory, "both", (ALL_OK,) * 90, {"athlete": "Anna Berg", "bib": "17"})
    (made := log.with_name("made")).mkdir()
    write_kinogram(made, "17", "Anna Berg", 100)
    (made / "kinogram-2.jpg").write_bytes(to_jpeg(np.zeros((40, 200), np.uint8)))
    for end in ("", "-2"):
        (made / f"jumper{end}.c3d").write_text("C3D")
    pulses = [{"number": number, "takeoff": {"pulse": pulse}} for number, pulse in ((1, 12.0), (2, 61.0))]
    (made / "jumper.json").write_text(json.dumps({"jumps": pulses}))
    speeds = [MeasuredValue(value=speed, sigma=0.01) for speed in (25.0, 26.0)]
    jumps = tuple(
        MEASURED.model_copy(update={"recording": "both", "jump": number, "takeoff_speed": speed})
        for number, speed in enumerate(speeds, 1)
    )
    keep_result(made, log, jumps)
    service.last_jump = jumps[-1]
    with hill.panel.client(headers={"Authorization": f"Bearer {TOKEN}", "Host": f"{NAME}:{hill.panel.port}"}) as coach:
        link = coach.get("/api/recordings/both/link").json()["link"]
    phone = open_page(link, width=360, height=780, has_touch=True, is_mobile=True, reduced_motion="reduce")
    replay, picture = phone.locator("#visit-replay"), phone.locator("#visit-pictures img")
    for number, pulse, speed, width in ((2, "61", "93.6", 200), (1, "12", "90.0", 100)):
        choice = phone.locator("#visit-choice").get_by_role("button", name=f"Jump {number}")
        if number == 1:
            choice.click()
        expect(choice).to_have_attribute("aria-pressed", "true")
        expect(replay).to_have_attribute("data-pulse", pulse)  # it stands still at the take-off
        expect(phone.locator("#visit-figures > div").first).to_contain_text(f"{speed}\u202fkm/h")
        expect(picture).to_have_count(1)
        expect(picture).to_have_js_property("naturalWidth", width)
        expect(phone.locator("#visit-others a")).to_have_count(2)  # one C3D, and the kinogram's file
    assert_fits_a_phone(phone)

    screen = open_page("about:blank")
    asked = _watched(screen)
    screen.goto(f"{hill.url}/#/coach")
    hill.log_in(screen)
    expect(screen.locator("#coach-figures b").first).to_have_text("93.6")
    expect(screen.locator("#coach-replay")).to_have_attribute("data-stage", "ready")
    assert [path for path in asked if "/moment" in path][-1].endswith("both/moment?jump=2")

    live = open_page("about:blank", reduced_motion="reduce")
    live.goto(f"{hill.url}/#/live")
    hill.log_in(live)
    live.locator("#measured").scroll_into_view_if_needed()
    expect(live.locator("#measured-figures > div").first).to_contain_text("93.6")
    expect(live.locator("#measured-replay")).to_have_attribute("data-pulse", "61")
    live.locator("#measured-who").click()
    expect(live.locator("#jump-choice").get_by_role("button", name="Jump 2")).to_have_attribute("aria-pressed", "true")


def test_a_link_is_taken_back_on_the_page_of_its_jump(hill: Hill, open_page: Open) -> None:
    with hill.panel.client(headers={"Authorization": f"Bearer {TOKEN}", "Host": f"{NAME}:{hill.panel.port}"}) as coach:
        link = coach.get("/api/recordings/jump-2/link").json()["link"]
    phone = open_page(link, width=360, height=780)
    expect(phone.locator("#visit-who")).to_have_text("4 · Ola <b>Nordmann</b>")
    page = open_page(f"{hill.url}/#/recordings/jump-2", width=360, height=780, locale="nb-NO")
    hill.log_in(page)
    links, code = page.locator("#share-links li"), page.locator("#share-code")
    expect(links).to_have_text([re.compile(r", \d\d:\d\d, til .*, \d\d:\d\dTrekk tilbake$")])
    hill.clock.now += 600
    page.get_by_role("button", name="Vis koden").click()
    expect(code).to_be_visible()
    expect(links).to_have_count(2)
    assert_fits_a_phone(page)
    page.evaluate(AXE.read_text())
    assert page.evaluate("axe.run().then(found => found.violations.map(each => each.id))") == []
    links.first.get_by_role("button").click()
    expect(links).to_have_count(1)
    expect(code).to_be_hidden()  # perhaps it is the one that opens nothing any more
    phone.reload()
    expect(phone.locator("#visit-problem")).to_have_text(
        "this link was taken back: ask the coach for the code of the jump"
    )
    expect(phone.locator("#visit-jump")).to_be_hidden()


def test_the_delayed_picture_takes_bounded_memory_and_keeps_its_time(hill: Hill, open_page: Open) -> None:
    page = open_page(f"{hill.url}/#/jump/none")
    found = page.evaluate("""async () => {
        const main = document.querySelector("script").src;
        const { makeDelay, BYTES_MAX } = await import(main.replace("main.js", "jump/delayed.js"));
        let now = 0;
        const delay = makeDelay(() => now);
        const most = { pictures: 0, bytes: 0 };
        const late = [];
        for (let at = 0; at < 120_000; at += 100) {
            now = at;
            delay.put(new Blob([new Uint8Array(1e6)], { type: String(at) }));
            const { pictures, bytes } = delay.held();
            most.pictures = Math.max(most.pictures, pictures);
            most.bytes = Math.max(most.bytes, bytes);
            const shown = delay.take(60);
            if (shown) late.push(now - Number(shown.type));
        }
        now += 70_000;
        return { most, limit: BYTES_MAX, earliest: Math.min(...late), latest: Math.max(...late), old: delay.take(60) };
    }""")
    assert found["most"]["bytes"] <= found["limit"]
    assert found["most"]["pictures"] < 60
    assert 60_000 <= found["earliest"] <= found["latest"] < 63_000
    assert found["old"] is None
