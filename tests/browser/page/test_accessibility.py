"""Thumbs in gloves, and who cannot see the page: sizes of what is touched, and what axe finds."""

import json
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from rig.api.status import State
from tests.browser.conftest import MEASURED, Open
from tests.browser.views import AXE, READY, SMALLEST_TOUCH_PX, TOO_SMALL, enter
from tests.support.repeats import repeats
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel


@pytest.mark.parametrize("locale", repeats(["nb-NO", "en-GB"]))
def test_a_narrow_phone_scrolls_down_only_and_takes_gloves(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, locale: str
) -> None:
    service.arm()
    service.last_jump = MEASURED
    page = open_page(panel.url, width=360, height=780, locale=locale, has_touch=True, is_mobile=True)
    for view in READY:
        enter(page, panel, view)
        assert page.evaluate("document.documentElement.scrollWidth") == 360, view
        assert not page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX), view


def _grave(page: Page) -> list[str]:
    found: dict[str, Any] = page.evaluate("axe.run({ resultTypes: ['violations'] })")
    return [
        f"{violation['id']}: {violation['help']}: {json.dumps([node['html'][:150] for node in violation['nodes'][:3]])}"
        for violation in found["violations"]
        if violation["impact"] in {"serious", "critical"}
    ]


@pytest.mark.parametrize(
    ("look", "width"),
    [
        ("outdoor", 360),
        pytest.param("light", 1280, marks=pytest.mark.long),
        pytest.param("light", 360, marks=pytest.mark.long),
        pytest.param("dark", 360, marks=pytest.mark.long),
        pytest.param("dark", 1280, marks=pytest.mark.long),
    ],
)
def test_axe_finds_nothing_grave(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, look: str, width: int
) -> None:
    if not AXE.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {AXE.parents[2]}, or `make test`")
    service.last_jump = MEASURED
    page = open_page(
        panel.url, width=width, color_scheme="light" if look == "outdoor" else look, reduced_motion="reduce"
    )
    page.evaluate("look => localStorage.setItem('svev.look', JSON.stringify(look))", look)
    page.reload()
    page.evaluate(AXE.read_text())
    for view in READY:
        enter(page, panel, view)
        assert not _grave(page), view
    page.goto(f"{panel.url}/#/live")
    for state in (State.ARMING, State.ARMED, State.RECORDING, State.DISARMING, State.FAULT):
        service._become(state)
        expect(page.locator("#state")).to_have_attribute("data-state", state.value)
        assert not _grave(page), state
    page.locator("#open-settings").click()
    assert not _grave(page), "settings"
