"""A measured jump in the folder of the recordings."""

import re
import shutil
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from analysis.cameras.standing import Standing
from analysis.report.overlay_file import write_overlay
from analysis.result import file as result_file
from analysis.worker.findings import summary
from service.measuring.keeping import keep_result
from tests.analysis.report.jumps import jump_log, measured_recording
from tests.analysis.simulated import RATE_HZ, true_cameras
from tests.webpanel.memory_service import MemoryService

TAKEOFF = 30
FIRST = 22  #: pulse of the log
#: Notes which pulses are shown, from now on.
WATCH = """() => {
    window.seen = [];
    const where = document.getElementById("frame-where");
    new MutationObserver(() => seen.push(parseInt(where.textContent))).observe(where, { childList: true });
}"""


def shows(page: Page, pulse: int) -> None:
    """Expect that a pulse is in sight."""
    expect(page.locator("#frame-where")).to_have_text(re.compile(f"^{pulse} / "))


@pytest.fixture(scope="session")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with rendered images of a jump; its result lies beside it."""
    log = tmp_path_factory.mktemp("log") / "jump.mcap"
    log.symlink_to(jump_log(1))
    made, result = log.parent / "made", measured_recording()
    made.mkdir()
    result_file.write(result, made / "jumper.json")
    write_overlay(result, {1: Standing(true_cameras(), {})}, made / "overlay.json")
    keep_result(made, log, (summary("jump", RATE_HZ, result.jumps[0], None),))
    return log


@pytest.fixture
def overlay(service: MemoryService, measured: Path) -> Path:
    """What is drawn of the jump; its log and result are in the folder of the recordings."""
    folder = service.catalogue.directory
    shutil.copy(measured, folder / "jump.mcap")
    shutil.copytree(measured.with_suffix(".measured"), folder / "jump.measured")
    return folder / "jump.measured" / "overlay.json"
