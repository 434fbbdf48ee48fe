"""Debian's Chromium without a window (its headless shell starts in half the time), and pages that must not complain."""

import asyncio
import json
import os
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, expect, sync_playwright

from rig.api.jump import LastJump, MeasuredValue
from rig.frame import FrameStatus
from rig.phrase import phrase
from service.measuring.keeping import keep_result
from tests.recorder.logs import ALL_OK
from tests.support.processes import shared_from_now_on
from tests.webpanel.conftest import client, panel
from tests.webpanel.memory_service import MemoryService, write_recording

__all__ = ["browser", "client", "open_page", "panel"]

#: The machine may be busy: what is waited for takes a second or two on a quiet one.
PATIENCE_MS = 40_000
#: What the browser itself says of answers that the page handles: refusals, and a service that is gone on purpose.
_HANDLED = ("Failed to load resource", "net::ERR_")

#: A microphone that beeps, and nobody who has to be asked for it.
_MICROPHONE = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
#: No process that waits in reserve for a page of the same context: each test has another context.
_ONE_AT_A_TIME = ("--renderer-process-limit=1",)

expect.set_options(timeout=PATIENCE_MS)

Open = Callable[..., Page]


@dataclass(frozen=True, slots=True)
class SharedBrowser:
    """A browser, and the event loop that serves it in this thread.

    Between two calls Playwright's loop counts as running, so that a test which knows nothing of the browser could not
    run one of its own.
    """

    browser: Browser
    loop: asyncio.AbstractEventLoop

    @contextmanager
    def in_use(self) -> Iterator[Browser]:
        """Within, its loop counts as running."""
        asyncio.events._set_running_loop(self.loop)
        try:
            yield self.browser
        finally:
            asyncio.events._set_running_loop(None)


def _one_thread() -> ThreadPoolExecutor:
    """What Playwright reads files in: a thread that is there from the beginning, so that no test leaves it behind."""
    executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix="playwright")
    executor.submit(lambda: None).result()
    return executor


@pytest.fixture(scope="session")
def shared_browser(run_token: str) -> Iterator[SharedBrowser]:
    """One browser for all tests of this worker; each test has a context of its own, with its own cache and storage."""
    path = shutil.which("chromium-headless-shell")
    if path is None:
        pytest.skip("no browser (Debian package chromium-headless-shell): the page cannot be tried")
    arguments = [*_MICROPHONE, *_ONE_AT_A_TIME, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with ExitStack() as stack:
        with shared_from_now_on(run_token):
            playwright = stack.enter_context(sync_playwright())
            chromium = playwright.chromium.launch(executable_path=path, args=arguments, timeout=PATIENCE_MS)
            shared = SharedBrowser(chromium, asyncio.get_running_loop())
            shared.loop.set_default_executor(stack.enter_context(_one_thread()))
        asyncio.events._set_running_loop(None)
        yield shared
        asyncio.events._set_running_loop(shared.loop)  # until Playwright has ended it
        chromium.close()


@pytest.fixture
def browser(shared_browser: SharedBrowser) -> Iterator[Browser]:
    """The browser, for one test."""
    with shared_browser.in_use() as chromium:
        yield chromium


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Open]:
    """Opens pages: `open_page(url, width=360, height=780, locale="nb-NO", color_scheme="dark")`.

    A page that raises an error, or writes one to the console, fails the test.
    """
    contexts: list[BrowserContext] = []
    complaints: list[str] = []

    def hear(message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"} and not any(handled in message.text for handled in _HANDLED):
            complaints.append(message.text)

    def open_one(url: str, *, width: int = 1280, height: int = 800, locale: str = "en-GB", **more: Any) -> Page:
        context = browser.new_context(viewport={"width": width, "height": height}, locale=locale, **more)
        contexts.append(context)
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.on("console", hear)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(url)
        return page

    yield open_one
    for context in contexts:
        context.close()
    assert not complaints


MEASURED = LastJump(
    recording="jump-2",
    jump=1,
    time=datetime(2026, 2, 14, 10, 15, 30, tzinfo=UTC),
    ok=True,
    verdict="measured well: all points in 35 of 35 pulses in sight",
    said=(phrase("jump_counted", "all points in {count} of {pulses} pulses in sight", count=35, pulses=35),),
    takeoff_speed=MeasuredValue(value=26.104, sigma=0.0151),
    perpendicular=MeasuredValue(value=2.1085, sigma=0.115),
    speed_20_m=MeasuredValue(value=25.489, sigma=0.004),
    angle_of_attack=MeasuredValue(value=19.5121, sigma=0.5),
    ski_to_body=MeasuredValue(value=9.12, sigma=0.04),
)


def write_kinogram(folder: Path, bib: str, athlete: str, width: int = 1080) -> None:
    """The files of a kinogram, with a grey picture of its size."""
    content = {"format": "svev-kinogram/1", "recording": "jump", "athlete": athlete, "bib": bib, "jumps": []}
    (folder / "kinogram.json").write_text(json.dumps(content), encoding="utf-8")
    (folder / "kinogram.html").write_text("<!doctype html><title>Kinogram</title><h1>Five pictures</h1>")
    (folder / "kinogram.jpg").write_bytes(cv2.imencode(".jpg", np.full((2019, width), 120, np.uint8))[1].tobytes())


def keep_measured(log: Path, jumps: tuple[LastJump, ...]) -> None:
    """Keep a result beside a log, without measuring it: main figures, and files with little in them."""
    made = log.parent / "made"
    made.mkdir()
    (made / "report.html").write_text("<!doctype html><title>Report</title><h1>For the coach</h1>")
    write_kinogram(made, "4", "Ola <b>Nordmann</b>")
    for name in (
        "overlay.mp4",
        "jumper.c3d",
        "jumper.trc",
        "jumper.csv",
        "jumper.json",
        "protocol.html",
        "protocol.txt",
    ):
        (made / name).write_text(name)
    keep_result(made, log, jumps)


@pytest.fixture
def service(tmp_path: Path) -> Iterator[MemoryService]:
    """The rig: idle, no recordings. It shows three pictures a second: a browser draws each without a graphics card."""
    with closing(MemoryService(tmp_path)) as rig:
        rig.pulses_a_picture = 10
        yield rig


@pytest.fixture
def jumps(service: MemoryService) -> None:
    """Two recordings, one with a lost frame; that one is measured."""
    folder = service.catalogue.directory
    write_recording(folder, "jump-1", (ALL_OK,) * 30, {"athlete": "Anna Berg", "bib": "17"})
    lost = (FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK)
    log = write_recording(folder, "jump-2", (lost, *(ALL_OK,) * 29), {"athlete": "Ola <b>Nordmann</b>", "bib": "4"})
    keep_measured(log, (MEASURED,))
