"""Who jumps: names on the page and the start list."""

from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Route, expect

from rig.api.recordings import RecordingOrder
from tests.browser.conftest import Open
from tests.browser.views import SMALLEST_TOUCH_PX, TOO_SMALL, enter
from tests.service.jumpers.test_workbook import book
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel


def test_names_of_athletes_are_text_and_nothing_else(panel: Panel, jumps: None, open_page: Open) -> None:
    page = open_page(panel.url)
    enter(page, panel, "recordings")
    expect(page.locator("#recordings-list")).to_contain_text("Ola <b>Nordmann</b>")
    page.get_by_role("searchbox").fill("anna")
    expect(page.locator("#recordings-list li")).to_have_count(1)


@pytest.mark.long
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
    wait_until(lambda: service.jumpers.view().next.session.athlete == "Beritx", "it is sent while he types")
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
    expect(first.get_by_role("alert")).to_contain_text('The list was not loaded: column "recording" has a name')
    second.get_by_role("button", name="Rediger").tap()
    second.locator("#list-file").set_input_files(tmp_path / "wrong.csv")
    expect(second.get_by_role("alert")).to_contain_text("kolonnen «recording» har et navn som hvert hopp bruker")
    second.get_by_role("alert").get_by_role("button", name="Lukk").tap()
    second.locator("#list-edit").tap()
    first.locator("#list-file").set_input_files(table)
    dialog = first.get_by_role("dialog", name="Load this list?")
    expect(dialog.get_by_role("status")).to_have_text("Jumpers in the file: 3; in the list now: 0.")
    expect(dialog.get_by_role("row")).to_have_text(["BibAthleteClub", "17Åse BjørkLyn", "18Berit", "19Cecilie"])
    assert service.jumpers.view().lines == ()
    dialog.get_by_role("button", name="Replace").tap()
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


def test_a_file_that_can_be_read_in_several_ways_is_chosen_from(
    panel: Panel, service: MemoryService, open_page: Open, tmp_path: Path
) -> None:
    service.jumpers.import_table(b"bib;athlete;gate\n1;Anna;12\n2;Berit;12\n")
    page = open_page(panel.url, width=360, height=780, locale="nb-NO", has_touch=True, is_mobile=True)
    page.get_by_role("button", name="Rediger").tap()
    dialog = page.get_by_role("dialog", name="Lese inn denne listen?")
    (tmp_path / "letters.csv").write_bytes("Startliste\nbib;athlete;klasse\n7;Anže Lanišek;J18\n".encode("cp1252"))
    page.locator("#list-file").set_input_files(tmp_path / "letters.csv")
    expect(dialog.locator("#list-choices button")).to_have_text(["Anže Lanišek", "Anûe Laniöek"])
    expect(dialog.get_by_role("button", name="Erstatt")).to_be_disabled()
    dialog.get_by_text("Anže Lanišek", exact=True).tap()
    expect(dialog.get_by_role("status")).to_have_text("Hoppere i filen: 1; i listen nå: 2.")
    expect(dialog).to_contain_text("Nye kolonner: klasse")
    expect(dialog).to_contain_text("Ikke lenger med: Bom")
    assert not page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX)
    dialog.get_by_role("button", name="Erstatt").tap()
    expect(page.locator("#list-rows li").first).to_contain_text("Anže Lanišek")

    (tmp_path / "list.xlsx").write_bytes(book(("Gutter", [["bib", "athlete"], [3, "Åse"]]), ("Jenter", [["bib"]])))
    page.locator("#list-file").set_input_files(tmp_path / "list.xlsx")
    dialog.get_by_text("Jenter").tap()
    expect(dialog.get_by_role("button", name="Tøm listen")).to_be_visible()  # a heading alone asks before it empties
    dialog.get_by_role("button", name="Avbryt").tap()
    expect(page.locator("#list-rows li").first).to_contain_text("Anže Lanišek")
    page.locator("#list-file").set_input_files(tmp_path / "list.xlsx")
    dialog.get_by_text("Gutter").tap()
    dialog.get_by_role("button", name="Erstatt").tap()
    expect(page.locator("#list-rows li").first).to_contain_text("3Åse")
