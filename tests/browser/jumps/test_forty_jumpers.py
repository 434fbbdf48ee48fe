"""A training through the page on two phones and a laptop: fingers tap twice, pages are reloaded and scrolled anywhere.

The service is real, and so are its processes; the cameras replay a small log, so that nothing but the operators counts.
"""

import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from recorder.reading.info import info
from tests.browser.conftest import Open
from tests.capture.rigs import write_rig
from tests.recorder.logs import ALL_OK, SHAPE, write_log
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

JUMPERS = [(str(bib), f"Jumper {bib}") for bib in range(101, 141)]
#: Between the two taps of a double tap, ms; one of 0.5 s is slow.
APART_MS = (60, 120, 250, 500)
#: A busy machine adds to that what it takes to deliver them.
QUICK_MS = (0, 60, 120)


@contextmanager
def _training(folder: Path, loopback: Loopback) -> Iterator[Serving]:
    """An armed service with three small cameras."""
    write_log(folder / "log.mcap", (ALL_OK,) * 40)
    rig = write_rig(folder, "replay", loopback, log=folder / "log.mcap")
    region = f"region = {{ width = {SHAPE[1] // 3}, height = {SHAPE[0]} }}"
    rig.write_text(rig.read_text().replace('backend = "replay"', f'backend = "replay"\n{region}'))
    with serving(folder, rig, loopback, command=(sys.executable, "-m", "tests.service.hasty", "serve")) as service:
        service.arm()
        service.await_cameras("ready", "ready", "ready")
        yield service


def _double_tap(page: Page, button: Locator, apart_ms: int) -> None:
    """Tap where the button is, twice, whatever it has become by the second time."""
    expect(button).to_be_enabled()
    box = button.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for pause_ms in (apart_ms, 0):
        if page.evaluate("navigator.maxTouchPoints"):
            page.touchscreen.tap(x, y)
        else:
            page.mouse.click(x, y)
        page.wait_for_timeout(pause_ms)


def _scroll(page: Page, share: float) -> None:
    """Scroll to this share of the page's height, as a finger that reads something has left it."""
    page.evaluate(
        "share => scrollTo(0, share * (document.documentElement.scrollHeight - innerHeight))",
        share,
    )


def _finished(service: Serving, count: int) -> None:
    """Wait until so many recordings are over, and the rig is armed."""

    def over() -> bool:
        status = service.get("/api/status")
        return status["state"] == "armed" and len(service.get("/api/recordings")) == count

    wait_until(over, f"{count} recordings are over", PATIENCE_S)


def _phone(open_page: Open, url: str) -> Page:
    return open_page(url, width=360, height=780, has_touch=True, is_mobile=True)


def test_double_taps_two_devices_and_a_reload_cost_no_jump(tmp_path: Path, loopback: Loopback, open_page: Open) -> None:
    with _training(tmp_path, loopback) as service:
        laptop, phone = open_page(service.url), _phone(open_page, service.url)
        for number, apart_ms in enumerate(APART_MS, 1):
            laptop.get_by_role("textbox", name="Bib").first.fill(str(number))
            expect(phone.locator("#next-step[data-step=armed] small")).to_have_text(str(number))
            _double_tap(phone, phone.locator("#next-step"), apart_ms)
            expect(laptop.locator("#jumping")).to_have_text(f"Being recorded: {number}")
            laptop.get_by_role("textbox", name="Bib").first.fill(f"{number}0")  # is not about this jump
            expect(phone.get_by_role("textbox", name="Bib").first).to_have_value(f"{number}0")
            (phone if number % 2 else laptop).reload()
            expect(phone.locator("#next-step[data-step=recording]")).to_be_enabled()
            expect(phone.locator("#next-step small")).to_have_text("")
            _double_tap(phone, phone.locator("#next-step"), apart_ms)
            _finished(service, number)
        assert service.state() == "armed", "the second tap has started nothing"
        recordings = service.get("/api/recordings")
    assert [each["session"]["bib"] for each in reversed(recordings)] == ["1", "2", "3", "4"]
    assert all(each["duration_s"] > 1 for each in recordings), "the second tap has stopped nothing"


@pytest.mark.timeout(400)
def test_forty_jumpers_forty_names_and_one_tap_for_each(tmp_path: Path, loopback: Loopback, open_page: Open) -> None:
    monkey, taps = random.Random(40), 0
    table = tmp_path / "list.csv"
    rows = [f"{bib};{name}" for bib, name in JUMPERS]
    table.write_bytes("\r\n".join(["bib;athlete", *rows]).encode("utf-16"))
    with _training(tmp_path, loopback) as service:
        laptop = open_page(service.url, width=1024, height=768)
        pages = [_phone(open_page, service.url), _phone(open_page, service.url), laptop]
        laptop.locator("#list-file").set_input_files(table)
        laptop.locator("#list-replace").click()
        for number, (bib, name) in enumerate(JUMPERS, 1):
            page, other = monkey.sample(pages, 2)
            if monkey.random() < 0.2:
                page.reload()
            expect(page.locator("#next-step[data-step=armed] small")).to_have_text(f"{bib} \N{MIDDLE DOT} {name}")
            _scroll(page, monkey.random())
            _double_tap(page, page.locator("#save-last"), monkey.choice(QUICK_MS))
            taps += 1
            if monkey.random() < 0.3:
                other.reload()
            _finished(service, number)
        for page in pages:
            expect(page.locator("#list-title")).to_have_text("Round 2: 0 of 40 have jumped")
        recordings = service.get("/api/recordings")
        lines = service.get("/api/start-list")["lines"]
    assert [each["session"]["bib"] for each in reversed(recordings)] == [bib for bib, _ in JUMPERS]
    assert [line["jumps"] for line in lines] == [[each["id"]] for each in reversed(recordings)]
    assert {each["verdict"]["level"] for each in recordings} <= {"good", "warning"}
    for each, (bib, name) in zip(reversed(recordings), JUMPERS, strict=True):
        session = info(service.data / f"{each['id']}.mcap").session
        assert (session["bib"], session["athlete"], session["round"]) == (bib, name, "1")
    assert taps == len(recordings), "one tap for each jump; the second ones were accidents"
