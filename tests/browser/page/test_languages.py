"""The page in English and Norwegian."""

import re

import pytest
from playwright.sync_api import expect

from rig.errors import StorageError
from rig.phrase import phrase, plain
from service.status.statements import recording_ended
from tests.browser.conftest import Open
from tests.browser.views import enter
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel


def test_norwegian_from_the_browser_and_by_choice(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open
) -> None:
    service.jumpers.import_table(b"bib;athlete;club\n17;Anna;Lyn\n")
    page = open_page(panel.url, locale="nb-NO")
    expect(page.locator("#state-word")).to_have_text("Av")
    expect(page.locator("#session-more")).to_have_text("Klubb: Lyn")
    expect(page.locator("#state-text")).to_contain_text("Kameraene er av.")
    expect(page.locator("html")).to_have_attribute("lang", "nb")
    enter(page, panel, "recordings/jump-2")
    expect(page.locator("#recording-verdict")).to_have_text("1 av 30 pulser mangler et bilde")
    expect(page.locator("#frame-fate")).to_contain_text("K2 tapt")
    expect(page.locator("#measurement-jumps .measured-why")).to_have_text("alle punkter i 35 av 35 pulser i sikte")
    page.keyboard.press("?")
    page.get_by_label("Språk").select_option("en")
    expect(page.get_by_role("heading", name="Settings and keys")).to_be_visible()
    page.get_by_role("button", name="Close").click()
    expect(page.locator("#frame-fate")).to_contain_text("K2 lost")
    expect(page.locator("#recording-verdict")).to_contain_text("1 of 30 pulses lack a frame")
    page.reload()
    expect(page.locator("html")).to_have_attribute("lang", "en")


def test_what_has_no_norwegian_of_its_own_is_quoted_behind_what_kind_it_is(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise StorageError("/media/jumps: cannot be written (Input/output error); make room")

    page = open_page(panel.url, locale="nb-NO")
    expect(page.locator("#state-word")).to_have_text("Av")
    monkeypatch.setattr(service, "arm", refuse)
    page.locator("#next-step").click()
    said = "det kan ikke skrives på disken: sjekk plass og feste (/media/jumps: cannot be written"
    expect(page.locator(".snack")).to_contain_text(said)
    (service.catalogue.directory / "strange.session.json").write_text("{")
    write_recording(service.catalogue.directory, "strange")
    page.goto(f"{panel.url}/#/recordings/strange")
    quoted = re.compile("Rettelsene ved siden av opptaket kan ikke leses: .*strange.session.json")
    expect(page.locator("#recording-verdict")).to_have_text(quoted)


def test_check_log_and_reasons_are_said_in_the_language_chosen(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    full = phrase("disk_full", "the disk is full: make room on it or record to another one")
    service.tell("warning", "disk", phrase("event_there_neither", "there neither: {why}", why=full))
    for _ in range(3):
        service.tell("info", "K1", plain("as the library says it"))
    page = open_page(f"{panel.url}/#/log", locale="nb-NO")
    told = page.locator("#log-list li", has_text="ikke der heller")
    expect(told).to_contain_text("advarsel")
    expect(told).to_contain_text("ikke der heller: disken er full: skaff plass på den, eller ta opp på en annen")
    expect(page.locator("#log-list li", has_text="K1")).to_have_text(re.compile(r"as the library says it\u00d7 3$"))
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
