"""What was measured in a recording, on its page."""

import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from recorder.log.beside import jumper_path
from rig.api.jump import LastJump, MeasuredValue
from rig.api.measuring import AfterStep, MeasuringQueue, MeasuringState, MeasuringStep
from rig.api.recordings import RecordingOrder
from rig.api.statement import Level, Statement
from rig.api.status import State
from rig.errors import NoJumpError
from rig.phrase import phrase
from rig.settings.model import AnalysisSettings
from service.measuring.keeping import keep_problem, keep_step
from service.offloading.notes import as_warning
from tests.browser.conftest import Open, keep_measured
from tests.browser.views import assert_fits_a_phone
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel

LIVE = LastJump(
    recording="jump-1",
    jump=1,
    time=datetime(2026, 2, 14, 10, 15, 30, tzinfo=UTC),
    live=True,
    ok=False,
    verdict="all points in 18 of 18 pulses in sight",
    takeoff_speed=MeasuredValue(value=26.1, sigma=0.2),
)


@pytest.fixture
def log(service: MemoryService, jumps: None) -> Path:
    """The log of `jump-1`, which nobody has measured; the rig file has an `[analysis]`."""
    survey = service.catalogue.directory / "hill.json"
    service.settings = service.settings.model_copy(update={"analysis": AnalysisSettings(survey=survey)})
    return service.catalogue.file("jump-1")


def _state(page: Page, words: str) -> None:
    expect(page.locator("#measurement-state")).to_have_text(words)


def test_figures_verdict_and_files_of_a_measured_jump(panel: Panel, jumps: None, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    expect(page.locator("#measurement-state")).to_have_text(
        re.compile(r"^Measured: Today, [\d:]{8} \(svev [\d.]+\w*\)\.$")
    )
    jump = page.locator("#measurement-jumps > section")
    expect(jump.locator(".mark")).to_have_text("Measured well")
    expect(jump.locator(".mark")).to_have_attribute("data-level", "good")
    expect(jump.locator(".measured-why")).to_have_text("all points in 35 of 35 pulses in sight")
    expect(jump.locator(".figures > div")).to_have_text(
        [
            "Take-off speed26.104 ± 0.015\u202fm/s\n94.0\u202fkm/h",
            "Perpendicular to the table2.11 ± 0.12\u202fm/s",  # as many digits as the report has
            "Speed at 20 m25.489 ± 0.004\u202fm/s\n91.8\u202fkm/h",
            "Angle of attack, 0.5 s19.5° ± 0.5°",
            "Ski to body, 0.5 s9.1° ± 0.04°",
        ]
    )
    files = page.locator("#measurement-files a")
    expect(files).to_have_text(["The coach's page", "Video", "C3D", "TRC", "CSV", "Protocol"])
    assert files.first.bounding_box()["height"] >= 60  # type: ignore[index]
    expect(page.locator("#measurement-others a")).to_have_text(["jumper.json", "protocol.txt"])
    with page.expect_popup() as opened:
        files.first.click()
    expect(opened.value.locator("h1")).to_have_text("For the coach")
    with page.expect_download() as got:
        files.nth(2).click()
    assert got.value.suggested_filename == "jump-2-jumper.c3d"


def test_progress_from_order_to_failure_without_loading_anew(
    panel: Panel, service: MemoryService, log: Path, open_page: Open
) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-1")
    _state(page, "Not measured yet.")
    page.get_by_role("button", name="Measure", exact=True).click()
    _state(page, "Waits to be measured: it is the next one.")
    expect(page.locator("#measurement-measure")).to_be_disabled()
    page.get_by_role("button", name="Cancel", exact=True).click()
    _state(page, "Not measured yet.")
    expect(page.locator("#measurement-cancel")).to_be_hidden()

    service.measure("jump-2")
    service.measure("jump-1")
    _state(page, "Waits to be measured, 1 before it.")
    service.give_up_measuring("jump-2")
    _state(page, "Waits to be measured: it is the next one.")
    running = MeasuringQueue(recording="jump-1", state=MeasuringState.MEASURING, step=MeasuringStep.SEARCH, share=0.4)
    _measuring(service, running)
    _state(page, "Measuring: looking for the jumper")
    expect(page.locator("#measurement-share")).to_have_text("40\u202f%")
    _measuring(service, running.model_copy(update={"share": 0.73}))
    expect(page.locator("#measurement-share")).to_have_text("73\u202f%")
    expect(page.locator("#measurement-bar")).to_have_js_property("value", 0.73)
    _measuring(service, running.model_copy(update={"paused": True}))
    _state(page, "Waits while a recording runs.")

    keep_problem(log, Statement(level=Level.WARNING, code="", text="hill.json: has no balls", advice="Survey them"))
    service.measurings._now.running = None
    service.give_up_measuring("jump-1")
    _state(page, "Could not be measured.")
    expect(page.locator("#measurement-problem .mark")).to_have_text("hill.json: has no balls")
    expect(page.locator("#measurement-problem .advice")).to_have_text("Survey them")
    expect(page.locator("#measurement-bar")).to_be_hidden()
    expect(page.get_by_role("button", name="Measure again")).to_be_enabled()


def _measuring(service: MemoryService, now: MeasuringQueue) -> None:
    """Let this be measured, as the status and the recording say."""
    service.measurings._now.running = now
    service._wake()


def test_where_nothing_can_be_measured_it_is_not_offered_and_the_page_says_why(
    panel: Panel, jumps: None, open_page: Open
) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-1", locale="nb-NO")
    _state(
        page,
        "Ikke målt ennå. Det kan ikke måles: ingenting sier hvor ballene er: gi riggfilen en [analysis] med innmåling "
        "eller kalibrering, og start tjenesten på nytt.",
    )
    expect(page.locator("#measurement-measure")).to_be_hidden()


def test_a_live_figure_is_never_measured_well(panel: Panel, log: Path, open_page: Open) -> None:
    jumper_path(log).write_text('{"summaries": [' + LIVE.model_dump_json() + "]}")
    page = open_page(f"{panel.url}/#/recordings/jump-1")
    _state(page, "Measured live; the log is not measured yet.")
    expect(page.locator("#measurement-jumps .mark")).to_have_text("Measured live")
    expect(page.locator("#measurement-jumps .mark")).to_have_attribute("data-level", "info")
    expect(page.locator("#measurement-jumps .measured-why")).to_have_text("all points in 18 of 18 pulses in sight")
    whole = LIVE.model_copy(update={"live": False, "ok": True})
    keep_measured(
        log, (whole, whole.model_copy(update={"jump": 2, "ok": False, "verdict": "the take-off was not found"}))
    )
    page.reload()
    expect(page.locator("#measurement-jumps h3")).to_have_text(re.compile(r"^Jump 1, [\d:]{8}$"))
    expect(page.locator("#measurement-jumps .mark")).to_have_text("Measured well")
    page.get_by_role("button", name="Jump 2").click()
    expect(page.locator("#measurement-jumps h3")).to_have_text(re.compile(r"^Jump 2, [\d:]{8}$"))
    expect(page.locator("#measurement-jumps .mark")).to_have_text("Doubtful")


def test_an_earlier_result_stays_when_measuring_again_fails(
    panel: Panel, jumps: None, service: MemoryService, open_page: Open
) -> None:
    keep_problem(service.catalogue.file("jump-2"), Statement(code="", text="no balls"))
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    expect(page.locator("#measurement-state")).to_have_text(
        re.compile("^Could not be measured. The figures are of an earlier measurement: Today, ")
    )
    expect(page.locator("#measurement-jumps .figures")).to_be_visible()
    expect(page.locator("#measurement-files a").first).to_be_visible()


def test_each_step_after_a_recording_is_shown_with_its_state(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open
) -> None:
    log = service.catalogue.file("jump-2")
    missing = Statement(level=Level.WARNING, code="storage", text="/backup: the folder for copies is not there")
    keep_step(log, AfterStep.VIDEO, None)
    service.measurings._queues.copies.notes.note(log, "", missing)
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    steps = page.locator("#measurement-steps li")
    expect(steps).to_have_text(["Measured: done", "Video: done", re.compile("^Copy: failed.*/backup: the folder")])
    expect(steps.nth(2).locator(".mark")).to_have_attribute("data-level", "warning")


def test_a_recording_in_progress_and_one_in_the_trash_have_one_quiet_line(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open
) -> None:
    service.delete_recording("jump-2")
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    _state(page, "Restore this jump to see what was measured.")
    expect(page.locator("#measurement-known")).to_be_hidden()
    page.get_by_role("button", name="Restore").click()
    expect(page.locator("#measurement-jumps .mark")).to_have_text("Measured well")
    service.arm()
    started = service.start_recording(RecordingOrder(bib="5"))
    page.goto(f"{panel.url}/#/recordings/{started.id}")
    _state(page, "It is measured when it has ended.")
    expect(page.locator("#measurement-known")).to_be_hidden()
    service.stop_recording(started.id)
    expect(page.locator("#measurement-state")).to_contain_text("Not measured yet.")


def test_the_live_view_says_whose_jump_was_last_how_it_was_and_how_many_wait(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service._become(State.ARMED)
    page = open_page(panel.url)
    card, queue, jumper = page.locator("#measured"), page.locator("#measured-queue"), page.locator("#measured-who")
    expect(page.locator("#state-word")).to_have_text("Armed")
    expect(card).to_be_hidden()
    started = service.start_recording(RecordingOrder(bib="17", athlete="Anna Berg", preroll_s=0))
    service.stop_recording(started.id)
    service.measurings._queues.measuring.add(started.id)
    service.measurings._now.running = MeasuringQueue(recording=started.id, state=MeasuringState.MEASURING, waiting=2)
    service.measuring = service.measurings._now.running
    service._wake()
    expect(jumper).to_have_text("17 · Anna Berg")
    expect(page.locator("#measured-far")).to_have_text("Still measuring")
    expect(queue).to_have_text("measuring 1, waiting 2")
    service.measuring = service.measurings._now.running.model_copy(
        update={"step": MeasuringStep.COPYING, "paused": True}
    )
    service._wake()
    expect(queue).to_have_text("copying 1 (waits while a recording runs), waiting 2")
    for hidden in ("#measured-figures", "#measured-verdict", "#measured-why"):
        expect(page.locator(hidden)).to_be_hidden()
    card.scroll_into_view_if_needed()
    replay = page.locator("#measured-replay")
    expect(replay).to_have_attribute("data-stage", "ready")
    first = replay.get_attribute("data-pulse")
    expect(replay).not_to_have_attribute("data-pulse", str(first))
    card.get_by_role("button", name="Stop").click()
    expect(card.get_by_role("button", name="Play")).to_be_visible()

    service.last_jump = LIVE.model_copy(update={"recording": started.id})
    service._wake()
    expect(page.locator("#measured-verdict")).to_have_text("Measured live")
    expect(page.locator("#measured-why")).to_have_text("all points in 18 of 18 pulses in sight")
    expect(page.locator("#measured-figures")).to_be_visible()
    service.measurings._queues.measuring.remove(started.id)
    service.measuring, service.measurings._now.running = None, None
    service._wake()
    expect(queue).to_be_hidden()
    jumper.click()
    expect(page.locator("#recording-title")).to_have_text("17 · Anna Berg")

    page.goto(f"{panel.url}/#/live")
    with panel.client() as client:
        assert client.patch(f"/api/recordings/{started.id}", json={"athlete": ""}).is_success
    expect(jumper).to_have_text("17 · name unknown")
    with panel.client() as client:
        assert client.delete(f"/api/recordings/{started.id}").is_success
    expect(card).to_be_hidden()


@pytest.mark.parametrize("outcome", [NoJumpError(phrase("why_no_jump", "no jumper in {log}", log="jump-2")), None])
def test_a_recording_without_a_jump_does_not_take_the_place_of_the_last_jump(
    panel: Panel, service: MemoryService, log: Path, open_page: Open, outcome: NoJumpError | None
) -> None:
    keep_measured(log, (LIVE.model_copy(update={"live": False, "ok": True}),))
    nobody = service.catalogue.file("jump-2")
    shutil.rmtree(nobody.with_name("jump-2.measured"))
    if isinstance(outcome, NoJumpError):
        keep_problem(nobody, as_warning(outcome.said))
    else:
        keep_measured(nobody, ())
    page = open_page(panel.url)
    expect(page.locator("#measured-who")).to_have_text("4 · Ola <b>Nordmann</b>")
    expect(page.locator("#measured-far")).to_have_text("No jump was found in it")
    service.last_jump = LIVE.model_copy(update={"live": False, "ok": True})
    service._wake()
    expect(page.locator("#measured-who")).to_have_text("17 · Anna Berg")
    expect(page.locator("#measured-figures")).to_be_visible()


@pytest.mark.parametrize("part", ["live", "recordings/jump-2"])
def test_a_phone_shows_all_of_it(panel: Panel, service: MemoryService, log: Path, open_page: Open, part: str) -> None:
    keep_problem(service.catalogue.file("jump-2"), Statement(level=Level.WARNING, code="", text="no balls " * 20))
    service.last_jump = LIVE
    service.measuring = MeasuringQueue(recording="x", state=MeasuringState.MEASURING, paused=True, waiting=12)
    for locale in ("en-GB", "nb-NO"):
        page = open_page(f"{panel.url}/#/{part}", width=360, height=780, locale=locale, has_touch=True, is_mobile=True)
        expect(page.locator(".figures:visible > div")).to_have_count(5)
        if part != "live":
            page.locator("#measurement-more summary").click()
        assert_fits_a_phone(page)
