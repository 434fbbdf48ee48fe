"""Pictures of the pages of measured jumps, to be looked at: every size, light and dark, both languages.

    python -m tests.browser.pictures OUT

The real service measures two jumps of the simulated hill; it takes a minute or two.
"""

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Final, Literal
from urllib.parse import quote

from playwright.sync_api import Browser, sync_playwright

from bench.analysis.hill_logs import write_hill_log
from tests.analysis.simulated import training
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import claim
from tests.support.waiting import wait_until

ATHLETE: Final = "Anna Øverbø"
WIDTHS: Final = (360, 768, 1280)
SCHEMES: Final[tuple[Literal["light", "dark"], ...]] = ("light", "dark")
LANGUAGES: Final = ("en-GB", "nb-NO")
#: What is there when a view has what it shows.
VIEWS: Final = {
    "jump": ("#/recordings/jump-2", "#kinogram-jumps img"),
    "coach": ("#/coach", "#coach-replay[data-stage=ready]"),
    "athlete": (f"#/athlete/{quote(ATHLETE)}", "#athlete-table td"),
    "comparison": ("api/comparison.html?first=jump-1&second=jump-2&language={language}", "main"),
}
_MEASURED_S: Final = 240


@contextmanager
def measured(folder: Path) -> Iterator[Serving]:
    """The service with two measured jumps of one athlete."""
    data = folder / "data"
    data.mkdir()
    with claim(0) as loopback:
        rig = write_rig(folder, "sim", loopback)
        for number in (1, 2):
            scenario = training().model_copy(update={"seed": number})
            log = write_hill_log(folder / f"hill-{number}", scenario, range(16, 66))
            shutil.copy(log.path, data / f"jump-{number}.mcap")
        rig.write_text(rig.read_text() + f'[analysis]\nsurvey = "{log.survey}"\n')
        with serving(folder, rig, loopback, data=data) as service:
            for number in (1, 2):
                path = f"/api/recordings/jump-{number}"
                service.call("PATCH", path, {"athlete": ATHLETE, "bib": "17", "gate": "12"})
                service.call("POST", f"{path}/measurement")
            wait_until(
                lambda: all(_is_done(service, number) for number in (1, 2)), "both are measured", _MEASURED_S, 0.5
            )
            yield service


def _is_done(service: Serving, number: int) -> bool:
    return bool(service.get(f"/api/recordings/jump-{number}/measurement?jumps=false")["state"] == "done")


def take(browser: Browser, service: Serving, out: Path) -> None:
    """Take all pictures."""
    for width, scheme, locale in product(WIDTHS, SCHEMES, LANGUAGES):
        context = browser.new_context(
            viewport={"width": width, "height": 780 if width < 600 else 900}, locale=locale, color_scheme=scheme
        )
        for name, (address, ready) in VIEWS.items():
            page = context.new_page()
            page.goto(f"{service.url}/{address.format(language=locale[:2])}")
            page.locator(ready).first.wait_for()
            page.screenshot(path=out / f"{name}-{width}-{scheme}-{locale[:2]}.png", full_page=name != "coach")
            page.close()
        context.close()


def main() -> None:
    """Write the pictures into the folder that is named."""
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, measured(Path(folder)) as service, sync_playwright() as playwright:
        arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
        chromium = shutil.which("chromium-headless-shell")
        browser = playwright.chromium.launch(executable_path=chromium, args=arguments)
        take(browser, service, out)
        browser.close()


if __name__ == "__main__":
    main()
