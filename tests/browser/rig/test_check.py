"""The view that checks the rig: rehearsals from several phones, and what they showed."""

import re
from dataclasses import asdict
from datetime import UTC, datetime

import pytest
from playwright.sync_api import Page, expect

from rig.api.parts import PartsView
from rig.api.recordings import RecordingOrder
from rig.api.rehearsal import Rehearsal, RehearsalOrder, Rehearsals, RehearsalVerdict
from rig.api.statement import Level, Statement
from rig.api.status import Finding, RehearsalProgress, RehearsalStage
from rig.phrase import Phrase
from rig.settings.camera import CameraSettings, Region
from service.regions import unfit
from svev.doctor.finding import Topic, failure, passed
from tests.browser.conftest import Open
from tests.browser.views import BROKEN, assert_fits_a_phone
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel

GOOD = Rehearsal(
    verdict=RehearsalVerdict.READY,
    statement=Statement(level=Level.GOOD, code="rehearsal_ready", text="ready to record"),
    line="headroom 2.1x (disk), room for 143 jumps, spread within a pulse 12 us",
    ended=datetime(2026, 2, 14, 9, 5, tzinfo=UTC), seconds=5, pulses=150, complete=150,
    headroom={"disk": 2.1, "enp2s0": 3.4}, jumps=143, spread_us=12.0,
    findings=(Finding.model_validate(asdict(passed(Topic.DISK, "check_read_back", "{mb:.1f} MB read", mb=138.2))),),
)  # fmt: skip
WRONG = failure(
    Topic.CAMERAS, "check_exposes_on", "{camera}: it exposes for {exposure:.1f} ms, pulses come every {period:.1f} ms",
    "shorten exposure_us, or lower trigger.rate_hz", camera="K3", exposure=40.0, period=33.3,
)  # fmt: skip
BAD = GOOD.model_copy(
    update={
        "verdict": RehearsalVerdict.NOT_READY,
        "statement": Statement(
            level=Level.ERROR, code="rehearsal_not_ready", text=f"not ready: {WRONG.what}", advice=WRONG.remedy,
            values={"why": Phrase(WRONG.code, WRONG.what, WRONG.values)},
        ),
        "headroom": {"disk": 0.8},
        "findings": (*GOOD.findings, Finding.model_validate(asdict(WRONG))),
    }
)  # fmt: skip


def test_two_phones_have_one_rehearsal_and_the_same_verdict(
    panel: Panel, service: MemoryService, open_page: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[RehearsalOrder] = []
    rehearse = service.rehearse

    def counted(order: RehearsalOrder) -> Rehearsals:
        begun.append(order)
        return rehearse(order)

    monkeypatch.setattr(service, "rehearse", counted)
    first = open_page(f"{panel.url}/#/doctor", width=360, height=780)
    second = open_page(f"{panel.url}/#/doctor", width=360, height=780, locale="nb-NO")
    first.locator("#rehearse").dblclick()
    for page in (first, second):
        expect(page.locator("#rehearsal-running")).to_be_visible()
        expect(page.locator("#rehearse")).to_be_hidden()
    assert len(begun) == 1
    service.show_rehearsal(RehearsalProgress(stage=RehearsalStage.RECORDING, done=60, pulses=150))
    expect(first.locator("#rehearsal-stage")).to_have_text("Recording: 60 of 150 pulses")
    expect(second.locator("#rehearsal-bar")).to_have_js_property("value", 60)

    service.rehearsed = GOOD
    service.show_rehearsal(None)
    for page, word in ((first, "Ready"), (second, "Klar")):
        expect(page.locator("#rehearsal-word")).to_have_text(word)
        expect(page.locator("#rehearsal-time")).to_have_attribute("datetime", "2026-02-14T09:05:00Z")
        expect(page.locator("#rehearsal-figures div")).to_have_count(4)
    assert _figures(first) == ["2.1 \N{MULTIPLICATION SIGN}", "143", "12 µs", "150 / 150"]

    second.locator("#rehearse").click()
    expect(first.locator("#rehearse-end")).to_be_visible()
    first.locator("#rehearse-end").click()
    expect(second.locator("#rehearsal-word")).to_have_text("Klar")  # one that was ended has no verdict

    service.arm()
    for page in (first, second):
        expect(page.locator("#rehearse")).to_be_disabled()
        expect(page.locator("#rehearse-why")).to_be_visible()


def _figures(page: Page) -> list[str]:
    return [re.sub(r"\s", " ", text) for text in page.locator("#rehearsal-figures dd").all_inner_texts()]


def test_what_is_wrong_comes_first_with_what_to_do(panel: Panel, service: MemoryService, open_page: Open) -> None:
    service.rehearsed = BAD
    page = open_page(f"{panel.url}/#/doctor", width=360, height=780, locale="nb-NO")
    expect(page.locator("#rehearsal-word")).to_have_text("Ikke klar")
    expect(page.locator("#rehearsal-text")).to_contain_text("K3: eksponerer i 40 ms")
    expect(page.locator("#rehearsal-advice")).to_have_text("gjør exposure_us kortere, eller senk trigger.rate_hz")
    expect(page.locator("#rehearsal-figures [data-level=error] dd")).to_have_count(1)
    page.locator("#rehearsal-everything summary").click()
    expect(page.locator("#rehearsal-findings .finding").first).to_have_attribute("data-level", "error")
    assert_fits_a_phone(page)


def test_the_rate_of_the_pulses_is_changed_and_kept_and_they_are_stopped_and_started(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    page = open_page(f"{panel.url}/#/doctor", width=360, height=780, locale="nb-NO")
    wanted, use, save, said = (page.locator(f"#pulses-{name}") for name in ("wanted", "use", "save", "said"))
    expect(page.locator("#pulses-source")).to_have_text("En linje på denne datamaskinen lager 30 i sekundet.")
    expect(use).to_be_disabled()
    for rate in ("40 /s", "50 /s"):
        page.locator("#pulses-faster").click()
        expect(wanted).to_have_text(rate)
    assert service.pulses_made.rate_hz == 30
    use.click()
    expect(page.locator("#pulses-source")).to_contain_text("50 i sekundet")
    expect(said).to_contain_text("lagre det")
    save.click()
    expect(said).to_have_text("Riggfilen sier det samme.")
    assert (service.pulses_made.rate_hz, service.pulses_made.saved) == (50, True)
    assert_fits_a_phone(page)
    made = page.locator("#pulses-fired")
    expect(made).to_be_hidden()
    expect(page.locator("#pulses-run")).to_be_hidden()
    service.arm()
    expect(made).to_contain_text(re.compile("laget 1.203 siden riggen ble gjort klar, og utelatt 2 "))
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    state, run = page.locator("#pulses-state"), page.locator("#pulses-run")
    expect(state).to_have_text("Pulsene går")
    run.click()
    expect(state).to_have_text("Pulsene er stoppet")
    page.locator("#pulses-burst").click()
    expect(page.locator("#snacks")).to_contain_text("10 pulser lages")
    assert (service.pulses_made.running, service.bursts) == (False, [10])
    assert page.evaluate(BROKEN) == []
    run.click()
    expect(state).to_have_text("Pulsene går")
    service.start_recording(RecordingOrder())
    expect(page.locator("#pulses-slower")).to_be_disabled()
    expect(said).to_have_text("Ikke mens et opptak går.")


def test_recordings_are_split_from_the_next_one_on(panel: Panel, service: MemoryService, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/doctor", width=360, height=780, locale="nb-NO")
    seconds, size, use, save, said = (
        page.locator(f"#parts-{name}") for name in ("part_s", "part_gb", "use", "save", "said")
    )
    expect(said).to_have_text("Riggfilen sier det samme.")
    expect(seconds).to_have_attribute("placeholder", "aldri")
    expect(use).to_be_disabled()
    size.fill("4")
    expect(said).to_have_text("Ikke tatt i bruk ennå.")
    use.click()
    expect(said).to_contain_text("lagre det")
    assert service.split == PartsView(part_s=None, part_gb=4.0, saved=False)
    seconds.fill("600")
    size.fill("")
    use.click()
    expect(use).to_be_disabled()
    save.click()
    expect(said).to_have_text("Riggfilen sier det samme.")
    assert service.split == PartsView(part_s=600.0, part_gb=None, saved=True)
    seconds.fill("0")
    use.click()  # the browser refuses it
    assert service.split.part_s == 600.0
    assert_fits_a_phone(page)
    assert page.evaluate(BROKEN) == []


def test_another_region_is_used_and_kept_and_calibrations_that_do_not_fit_are_said(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    fitting = service.lights["K2"]
    rig = CameraSettings(name="K2", backend="sim", region=fitting.region, calibrated_region=Region())
    service.lights["K2"] = fitting.model_copy(update={"calibration": unfit(rig)})
    page = open_page(f"{panel.url}/#/doctor", width=360, height=780, locale="nb-NO", color_scheme="dark")
    x, width, height = (page.locator(f"#region-{name}") for name in ("x", "width", "height"))
    use, save, said, wrong = (page.locator(f"#region-{name}") for name in ("use", "save", "said", "unfit"))
    expect(width).to_have_value("160")
    expect(said).to_have_text("Riggfilen sier det samme.")
    expect(wrong).to_be_hidden()
    service.arm()
    page.locator("#region-whole").click()
    expect(height).to_have_value("240")
    expect(said).to_contain_text("Riggen gjøres klar på nytt")
    width.fill("161")  # off the steps of the camera: the browser says so, and nothing is sent
    use.click()
    assert service.lights["K1"].region == fitting.region
    width.fill("200")
    x.fill("8")
    use.click()
    expect(use).to_be_disabled()
    wait_until(
        lambda: service.lights["K1"].region == Region(x=8, y=0, width=200, height=240), "it is used", poll_s=0.05
    )
    expect(said).to_contain_text("Gjelder til tjenesten avsluttes")
    save.click()
    expect(save).to_be_disabled()
    expect(said).to_have_text("Riggfilen sier det samme.")

    page.locator("#region-cameras button", has_text="K2").click()
    expect(wrong).to_contain_text("K2 ble kalibrert med 640 x 480 px fra 0, 0, og leser ut 160 x 120 px fra 0, 0")
    service.start_recording(RecordingOrder())
    expect(width).to_be_disabled()
    expect(said).to_have_text("Ikke mens et opptak går.")
    assert_fits_a_phone(page)
