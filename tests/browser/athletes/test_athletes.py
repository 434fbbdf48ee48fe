"""An athlete's page, and the table of a day."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from analysis.result import file as result_file
from rig.api.jump import LastJump, MeasuredValue
from service.measuring.keeping import keep_result
from tests.analysis.result.recordings import recording
from tests.browser.conftest import Open
from tests.browser.views import assert_fits_a_phone
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel

NOON = datetime(2026, 2, 14, 12, tzinfo=UTC)
ATHLETES = ("Ola Nordmann", "Kari / Ødegård;", "")


def _figures(jump: LastJump, number: int) -> LastJump:
    speed = 26.0 + 0.1 * (number % 5)
    return jump.model_copy(
        update={
            "takeoff_speed": MeasuredValue(value=speed, sigma=0.05),
            "perpendicular": MeasuredValue(value=2.0 + 0.1 * (number % 3), sigma=0.1),
            "speed_20_m": None if number == 1 else MeasuredValue(value=speed - 0.4, sigma=0.004),
            "angle_of_attack": MeasuredValue(value=20.0 + number % 4, sigma=0.5),
            "ski_to_body": MeasuredValue(value=9.0, sigma=0.2),
        }
    )


def keep_jump(folder: Path, number: int, time: datetime, athlete: str, leg_deg: float | None = None) -> None:
    """A recording with a measured jump, with its whole result if a change of the leg angle is given."""
    ok = number % 6 != 5
    log = write_recording(folder, f"jump-{number:02}", session={"athlete": athlete, "bib": f"{number}", "gate": "12"})
    jump = LastJump(recording=log.stem, jump=1, time=time, ok=ok, verdict="all points" if ok else "the hip was hidden")
    made = folder / "made"
    made.mkdir()
    if leg_deg is not None:
        result_file.write_json(result_file.to_json(recording(seed=number, leg_deg=leg_deg)), made / "jumper.json")
    keep_result(made, log, (_figures(jump, number),))


@pytest.fixture
def season(service: MemoryService) -> None:
    """Jumps of two athletes and of nobody on three days; the last day is the fourteenth of February."""
    for number in range(24):
        time = NOON - timedelta(days=number // 8, minutes=-number)
        keep_jump(service.catalogue.directory, number, time, ATHLETES[number % 8 % 3])


@pytest.mark.usefixtures("season")
def test_a_table_of_the_day_is_sorted_filtered_and_taken_away(panel: Panel, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings", locale="nb-NO", timezone_id="Europe/Oslo", accept_downloads=True)
    page.get_by_role("link", name="Dagens tabell").click()
    expect(page.locator("#day-date")).to_have_value("2026-02-14")
    rows = page.locator("#day-table tbody tr")
    expect(rows).to_have_count(8)
    expect(rows.nth(1).locator("td")).to_have_text(
        ["13:01:00", "1", "Kari / Ødegård;", "12", "26,10 ± 0,05\u202fm/s", "2,10 ± 0,10\u202fm/s",
         "\u2013", "21,0° ± 0,5°", "9,0° ± 0,2°", "Godt målt"]
    )  # fmt: skip
    expect(rows.nth(2).locator("td").nth(2)).to_have_text("Uten navn")
    speeds = page.get_by_role("button", name="Fart ved 20 m")
    speeds.click()
    speeds.click()
    expect(speeds.locator("xpath=..")).to_have_attribute("aria-sort", "descending")
    expect(rows.first.locator("td").nth(6)).to_have_text("26,000 ± 0,004\u202fm/s")
    expect(rows.last.locator("td").nth(6)).to_have_text("\u2013")
    page.locator("#day-athlete").select_option(label="Kari / Ødegård;")
    expect(rows).to_have_count(3)
    with page.expect_download() as got:
        page.get_by_role("button", name="Tabell til Excel (CSV)").click()
    assert got.value.suggested_filename == "svev-2026-02-14.csv"
    lines = Path(got.value.path()).read_bytes().decode().split("\r\n")
    assert lines[0].startswith("\ufeffDato;Tid;Startnr.;Utøver;Bom;Opptak;")
    assert lines[1].startswith(
        '2026-02-14;13:01:00;1;"Kari / Ødegård;";12;jump-01;1;26,1000;0,0500;2,1000;0,1000;;;21,'
    )
    assert lines[1].endswith(";Godt målt;all points")
    assert len(lines) == 5
    page.locator("#day-date").fill("2026-02-13")
    expect(page).to_have_url(re.compile("#/jumps/2026-02-13$"))
    expect(rows).to_have_count(8)
    page.locator("#day-date").fill("2026-02-01")
    expect(page.locator("#day-empty")).to_have_text("Ingen hopp ble målt denne dagen.")


@pytest.mark.usefixtures("season")
def test_an_athletes_page_is_reached_by_the_name_and_draws_each_figure_day_by_day(
    panel: Panel, open_page: Open
) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-01")
    page.locator("#recording-title").get_by_role("link", name="Kari / Ødegård;").click()
    expect(page.locator("#athlete-name")).to_have_text("Kari / Ødegård;")
    expect(page.locator("#athlete-count")).to_have_text("9 measured jumps on 3 days")
    charts = page.locator("#athlete-charts .chart")
    expect(charts).to_have_count(5)
    expect(charts.nth(0).locator(".dot")).to_have_count(9)
    expect(charts.nth(2).locator(".dot")).to_have_count(8)  # one speed at 20 m was not measured
    expect(charts.nth(0).locator(".mean")).to_have_count(3)
    expect(charts.nth(0).locator(".doubtful")).to_have_count(2)
    expect(charts.nth(0)).to_have_attribute(
        "aria-label", re.compile(r"^Take-off speed: mean of 7 well measured jumps 26\.\d\d m/s$")
    )
    expect(page.locator("#athlete-table tbody tr")).to_have_count(9)
    expect(page.locator("#spans-first-from")).to_have_value("2026-02-13")
    expect(page.locator("#spans-second-to")).to_have_value("2026-02-14")
    with panel.client() as client:
        assert client.patch("/api/recordings/jump-02", json={"athlete": "kari /  ødegård;"}).is_success
    expect(page.locator("#athlete-table tbody tr")).to_have_count(10)
    page.goto(f"{panel.url}/#/recordings")
    page.get_by_role("link", name="All jumps of Ola Nordmann").first.click()
    expect(page.locator("#athlete-name")).to_have_text("Ola Nordmann")
    page.goto(f"{panel.url}/#/athlete/Nobody")
    expect(page.locator("#athlete-empty")).to_have_text("No jump was measured here yet.")


def test_a_long_table_is_filled_and_sorted_to_its_end(panel: Panel, service: MemoryService, open_page: Open) -> None:
    for number in range(200):
        keep_jump(service.catalogue.directory, number, NOON - timedelta(minutes=number), "Ola")
    page = open_page(f"{panel.url}/#/athlete/ola", timezone_id="Europe/Oslo")
    rows = page.locator("#athlete-table tbody tr")
    expect(rows).to_have_count(200)
    page.get_by_role("button", name="Take-off speed").click()
    expect(rows).to_have_count(200)
    expect(rows.first.locator("td").nth(2)).to_have_text("26.00 ± 0.05\u202fm/s")
    expect(rows.last.locator("td").nth(2)).to_have_text("26.40 ± 0.05\u202fm/s")


@pytest.mark.long
def test_two_days_are_compared_by_the_service(panel: Panel, service: MemoryService, open_page: Open) -> None:
    for place, angle in enumerate((0.0, 1.0, 0.0, 10.0, 11.0, 10.0)):
        number = place + 10 * (place // 3)
        keep_jump(service.catalogue.directory, number, NOON + timedelta(days=place // 3), "Ola", angle)
    page = open_page(f"{panel.url}/#/athlete/ola", timezone_id="Europe/Oslo")
    page.get_by_role("button", name="Compare").click()
    expect(page.locator("#spans-said")).to_have_text(
        re.compile(r"^More than chance: leg angle \(3 jumps, then 3\)\. The athlete's scatter is that of 6 jumps\.")
    )
    first = page.locator("#spans-table tbody tr").first
    expect(first).to_have_class("different")
    expect(first.locator("td").nth(1)).to_have_text(re.compile(r"^\+(9|10|11)\.\d\u202f±\u202f\d\.\d\u202f°$"))
    service.arm()
    with panel.client() as client:
        assert client.post("/api/recordings", json={}).is_success
    page.get_by_role("button", name="Compare").click()
    expect(page.get_by_role("alert")).to_contain_text("Nothing is compared while a recording runs")


@pytest.mark.usefixtures("season")
@pytest.mark.parametrize("view", ["jumps", "athlete/Ola%20Nordmann"])
def test_a_phone_shows_all_of_it(panel: Panel, open_page: Open, view: str) -> None:
    for locale in ("en-GB", "nb-NO"):
        page: Page = open_page(
            f"{panel.url}/#/{view}", width=360, height=780, locale=locale, has_touch=True, is_mobile=True
        )
        expect(page.locator(".jumps td:visible").first).to_be_visible()
        assert_fits_a_phone(page)
