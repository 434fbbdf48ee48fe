"""From a tap on the phone to the page of the measured jump, and to the athlete's phone, with the real service."""

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from simrig.world.survey import survey
from tests.analysis.scene.hill import training
from tests.browser.conftest import Open
from tests.browser.jumps.test_training import arm, await_state, stop
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.long, pytest.mark.alone, pytest.mark.timeout(600)]

TOKEN = "a-token-of-more-than-sixteen-characters"  # noqa: S105 - of this test alone
#: A name that leads a browser here (RFC 6761, 6.3) and that the service takes for a name in the network.
NAME = "hill.localhost"
#: The balls want some seconds without a jumper.
_LENGTH = re.compile(r"0:(09|[1-5]\d)")
#: The measuring gets only the processor time that nobody else wants.
_MEASURED_MS = 240_000


def _log_in(page: Page) -> None:
    page.locator("#login-token").fill(TOKEN)
    page.locator("#login-submit").click()
    expect(page.locator("#login")).to_be_hidden()


def test_a_tap_records_a_jump_that_its_page_and_the_athletes_phone_show(
    tmp_path: Path, loopback: Loopback, open_page: Open
) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    rig.write_text(rig.read_text() + '[analysis]\nsurvey = "survey.json"\n')
    (tmp_path / "survey.json").write_text(json.dumps(survey(training())))
    reached = ("--allow-host", NAME, "--proxy", "127.0.0.1")
    environment = {"SVEV_TOKEN": TOKEN}
    with serving(tmp_path, rig, loopback, *reached, environment=environment, host="127.0.0.1", token=TOKEN) as service:
        address = service.url.replace("127.0.0.1", NAME)
        page = open_page(address, width=360, height=780)
        _log_in(page)
        page.get_by_role("textbox", name="Bib").fill("17")
        page.get_by_role("textbox", name="Athlete").fill("Anna Øverbø")
        arm(page)
        page.locator("#next-step[data-step=armed]").click()
        await_state(page, "Recording")
        expect(page.locator("#state-time")).to_have_text(_LENGTH)
        stop(page)
        page.get_by_role("button", name="Look at it").click()
        service.post("/api/disarm")  # simulated cameras take the processor that the measuring waits for
        expect(page.get_by_role("heading", level=1, name="17 · Anna Øverbø")).to_be_visible()
        figures = page.locator("#measurement-jumps .figures").first
        expect(page.locator("#measurement-state")).to_have_text(re.compile("^Measured: "), timeout=_MEASURED_MS)
        (recording,) = service.get("/api/recordings")
        jumps = service.get(f"/api/recordings/{recording['id']}/measurement?jumps=false")["figures"]
        whole = next(jump["jump"] for jump in jumps if jump["ok"])  # others may be cut by beginning or end
        if len(jumps) > 1:
            page.get_by_role("button", name=f"Jump {whole}", exact=True).click()
        expect(figures).to_contain_text(re.compile(r"2\d\.\d+ ± 0\.\d+\s*m/s"))
        expect(page.locator("#kinogram-jumps img")).to_have_js_property("naturalWidth", 1080)
        expect(page.locator(".stick").first).to_be_attached()
        result = service.data / f"{recording['id']}.measured"
        for name in ("kinogram.html", "report.html"):
            assert "Anna Øverbø" in (result / name).read_text(encoding="utf-8"), name

        page.locator("#recording-athlete").fill("Berit Ås")  # it was somebody else
        page.locator("#recording-athlete").press("Enter")
        wait_until(lambda: "Berit Ås" in (result / "kinogram.html").read_text(encoding="utf-8"), "it is corrected", 240)
        expect(page.locator("#kinogram-jumps img")).to_have_js_property("naturalWidth", 1080)
        assert "Anna" not in (result / "report.html").read_text(encoding="utf-8")

        page.locator("#share-show").click()
        expect(page.locator("#share-code")).to_be_visible()
        link = page.evaluate(
            "path => fetch(path).then(answer => answer.json())", f"./api/recordings/{recording['id']}/link"
        )
        phone = open_page(link["link"], width=360, height=780, locale="nb-NO")
        expect(phone.locator("#visit-who")).to_have_text("17 · Berit Ås")
        expect(phone.locator("#visit-figures > div")).to_have_count(5)
        expect(phone.locator("#visit-pictures img").first).to_have_js_property("naturalWidth", 1080)
        for path in ("status", "recordings", f"recordings/{recording['id']}/file", "events"):
            status = phone.evaluate("path => fetch(`./api/${path}`).then(answer => answer.status)", path)
            assert status in {401, 403}, path

        page.locator("#share-links button").click()
        expect(page.locator("#share-links li")).to_have_count(0)
        phone.reload()
        expect(phone.locator("#visit-problem")).to_have_text(
            "lenken er trukket tilbake: be treneren om koden til hoppet"
        )
        expect(phone.locator("#visit-jump")).to_be_hidden()
