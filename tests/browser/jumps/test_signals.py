"""Sounds, vibration and wake lock: what the browser was asked to do, at which moment."""

from datetime import UTC, datetime

import pytest
from playwright.sync_api import expect

from rig.api.statement import Level, Statement
from rig.api.status import Alarm, State
from tests.browser.conftest import Open
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel

#: Chromium without a window has no loudspeaker, motor or display: note what they are asked for.
NOTE = """
    globalThis.asked = [];
    const start = OscillatorNode.prototype.start;
    OscillatorNode.prototype.start = function (at) {
        asked.push(`tone ${this.frequency.value}`);
        start.call(this, at);
    };
    navigator.vibrate = pattern => { asked.push(`vibrate ${pattern}`); return true; };
    navigator.wakeLock.request = async () => {
        const lock = { released: false, async release() { this.released = true; asked.push("sleep"); } };
        asked.push("awake");
        return lock;
    };
"""


@pytest.mark.long
def test_started_stopped_and_fault_are_signalled_once_they_are_switched_on(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    page = open_page("about:blank")
    page.add_init_script(NOTE)
    page.goto(panel.url)

    def become(state: State) -> list[str]:
        service._become(state)
        expect(page.locator("#state")).to_have_attribute("data-state", state.value)
        asked: list[str] = page.evaluate("asked.splice(0)")
        return asked

    assert become(State.RECORDING) == become(State.ARMED) == become(State.FAULT) == [], "off until switched on"
    become(State.ARMED)
    page.locator("#open-settings").click()
    for name in ("sound", "vibration", "awake"):
        page.locator(f"#signal-{name}").check()
    page.locator("#settings-close").click()
    assert page.evaluate("asked.splice(0)")[-1] == "awake"
    assert become(State.RECORDING) == ["vibrate 200", "tone 660", "tone 990"]
    assert become(State.ARMED) == ["vibrate 100,80,100", "tone 990", "tone 660"]
    asked = become(State.FAULT)
    assert asked[:5] == ["vibrate 500,150,500,150,500", "tone 880", "tone 440", "tone 880", "tone 440"]
    assert become(State.IDLE) in ([], ["sleep"])
    page.reload()
    expect(page.locator("#state-word")).to_have_text("Idle")
    page.locator("#open-settings").click()
    expect(page.locator("#signal-sound")).to_be_checked()
    page.locator("#settings-close").click()

    def alarmed(level: Level) -> list[str]:
        said = Statement(level=level, code="", text="K2 misses pulses, 15 of 59", advice="check its trigger cable")
        service.alarms = (Alarm(number=1, topic="camera K2", since=datetime.now(UTC), statement=said),)
        service._wake()
        expect(page.locator(f"#alarms li[data-level={level}]")).to_contain_text(said.text)
        return tones()

    def tones() -> list[str]:
        asked: list[str] = page.evaluate("asked.splice(0)")
        return [each for each in asked if each.startswith("tone")]

    assert alarmed(Level.WARNING) == ["tone 784", "tone 784"]
    page.reload()
    assert alarmed(Level.ERROR) == [], "a browser makes no sound before the first touch"
    page.locator("#state").click()
    page.wait_for_function("asked.length > 0")
    assert tones() == ["tone 1175", "tone 1175", "tone 1175", "tone 880"]
    page.reload()
    expect(page.locator("#alarms")).to_contain_text("Check its trigger cable", ignore_case=True)
    page.locator("#alarms-sound").click()
    expect(page.locator("#alarms-sound")).to_have_text("Alarm sound on")
    assert tones() == alarmed(Level.WARNING) == []
    page.reload()
    expect(page.locator("#alarms-sound")).to_have_text("Alarm sound on")
    page.locator("#alarms-list").get_by_role("button", name="Seen").click()
    expect(page.locator("#alarms li[data-acknowledged]")).to_contain_text("seen, since")
    expect(page.locator("#alarms-list").get_by_role("button")).to_be_hidden()
    assert service.status().alarms[0].acknowledged
    alarmed(Level.ERROR)
    expect(page.locator("#alarms-list").get_by_role("button", name="Seen")).to_be_visible()
    service.alarms = ()
    service._wake()
    expect(page.locator("#alarms")).to_be_hidden()
