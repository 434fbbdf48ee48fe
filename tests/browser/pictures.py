"""Pictures of the pages of measured jumps, to be looked at: every size, light and dark, both languages.

    python -m tests.browser.pictures OUT

The real service measures two jumps of the simulated hill; it takes some minutes. Beside the pictures there is a sheet
of each view, as the documentation has it (`docs/images/panel-*.jpg`).
"""

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Final, Literal
from urllib.parse import quote

import cv2
import numpy as np
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

from bench.analysis.hill_logs import write_hill_log
from tests.analysis.simulated import training
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import claim
from tests.support.waiting import wait_until

ATHLETE: Final = "Anna Øverbø"
WIDTHS: Final = (360, 768, 1280)
HEIGHT: Final = 1000
#: The service is reached as from a phone, so that there is a code to show: by this name, which leads here (RFC 6761).
NAME: Final = "hill.localhost"
TOKEN: Final = "a-token-of-more-than-sixteen-characters"  # noqa: S105 - of these pictures alone
#: What a sheet shows, side by side, and how large.
SHEET: Final = ((1280, "light", "en"), (768, "dark", "nb"), (360, "dark", "en"), (360, "light", "nb"))
SCALE: Final = 0.6
#: What a phone shows of a jump below its kinogram: what is at the top, how it looks, and in which language.
PHONE: Final[tuple[tuple[str, Literal["light", "dark"], str], ...]] = (
    ("#player", "light", "en"), ("#curves", "light", "en"), ("#player", "dark", "nb"),
)  # fmt: skip
PHONE_SIZE: Final = (360, 780)
SCHEMES: Final[tuple[Literal["light", "dark"], ...]] = ("light", "dark")
LANGUAGES: Final = ("en-GB", "nb-NO")
#: What is there when a view has what it shows.
VIEWS: Final = {
    "jump": ("#/recordings/jump-2", "#kinogram-jumps img"),
    "coach": ("#/coach", "#coach-replay[data-pulse='24']"),  # he is in the middle of the pictures
    "day": ("#/jumps", "#day-table td"),
    "athlete": (f"#/athlete/{quote(ATHLETE)}", "#athlete-table td"),
    "comparison": ("api/comparison.html?first=jump-1&second=jump-2&language={language}", "main"),
}
_MEASURED_S: Final = 600


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
        reached = ("--allow-host", NAME, "--proxy", "127.0.0.1")
        environment = {"SVEV_TOKEN": TOKEN}
        with serving(
            folder, rig, loopback, *reached, data=data, environment=environment, host="127.0.0.1", token=TOKEN
        ) as service:
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
    address = service.url.replace("127.0.0.1", NAME)
    for width, scheme, locale in product(WIDTHS, SCHEMES, LANGUAGES):
        context = browser.new_context(viewport={"width": width, "height": HEIGHT}, locale=locale, color_scheme=scheme)
        context.set_default_timeout(1e3 * _MEASURED_S)
        _log_in(context.new_page(), address)
        for name, (path, ready) in VIEWS.items():
            page = context.new_page()
            page.goto(f"{address}/{path.format(language=locale[:2])}")
            page.locator(ready).first.wait_for()
            page.screenshot(path=_picture(out, name, width, scheme, locale[:2]))
            page.screenshot(path=out / f"{name}-{width}-{scheme}-{locale[:2]}-whole.png", full_page=True)
            page.close()
        context.close()
    for name in VIEWS:
        shown = [_picture(out, name, *how) for how in SHEET]
        _write_sheet(out / f"panel-{name}.jpg", shown, SCALE)
    _write_sheet(out / "panel-jump-phone.jpg", [_on_a_phone(browser, address, out, *how) for how in PHONE], 1.0)


def _on_a_phone(
    browser: Browser, address: str, out: Path, top: str, scheme: Literal["light", "dark"], language: str
) -> Path:
    width, height = PHONE_SIZE
    size: ViewportSize = {"width": width, "height": height}
    context = browser.new_context(viewport=size, locale=language, color_scheme=scheme, has_touch=True, is_mobile=True)
    _log_in(context.new_page(), address)
    page = context.new_page()
    path, ready = VIEWS["jump"]
    page.goto(f"{address}/{path}")
    page.locator(ready).first.wait_for()
    page.locator("#curves-plots svg").first.wait_for()
    page.evaluate("top => scrollTo(0, document.querySelector(top).getBoundingClientRect().top - 64)", top)
    page.locator("#frames .stick").first.wait_for()
    picture = out / f"phone-{top[1:]}-{scheme}-{language}.png"
    page.screenshot(path=picture)
    context.close()
    return picture


def _log_in(page: Page, address: str) -> None:
    page.goto(address)
    page.locator("#login-token").fill(TOKEN)
    page.locator("#login-submit").click()
    page.locator("#login").wait_for(state="hidden")
    page.close()


def _picture(out: Path, name: str, width: int, scheme: str, language: str) -> Path:
    return out / f"{name}-{width}-{scheme}-{language}.png"


def _write_sheet(out: Path, shown: Sequence[Path], scale: float) -> None:
    """Pictures of one height side by side with a gap, as a small file."""
    row: list[np.ndarray] = []
    for path in shown:
        picture = cv2.imread(str(path))
        if picture is None:
            raise FileNotFoundError(f"no picture {path}")
        row += [picture, np.full((len(picture), 24, 3), 255, np.uint8)]
    sheet = cv2.resize(np.hstack(row[:-1]), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(out), sheet, [cv2.IMWRITE_JPEG_QUALITY, 80])


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
