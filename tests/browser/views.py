"""The views of the page, and what must hold in each of them."""

from pathlib import Path

from playwright.sync_api import Page, expect

from tests.webpanel.serving import Panel

AXE = Path(__file__).with_name("npm") / "node_modules" / "axe-core" / "axe.min.js"
#: The views, and what is there when a view has what it shows.
READY = {
    "live": "#cameras li",
    "recordings": "#recordings-list li",
    "trash": "#recordings-empty",
    "recordings/jump-2": "#measurement-files a",
    "athlete/Ola%20%3Cb%3ENordmann%3C%2Fb%3E": "#athlete-table td",
    "jumps": "#day-table td",
    "log": "#log-list li, #log-empty",
    "doctor": "#doctor-run",
    "aim": "#aim-cameras button",
    "rig": "#rig-facts div",
    "coach": "#coach-replay[data-stage=ready]",
    "jump/jump-2": "#visit-files a",
}
SMALLEST_TOUCH_PX = 44
#: What a finger has to hit, and fails to have room for it.
TOO_SMALL = """least =>
    [...document.querySelectorAll("button, select, textarea, input:not([type=checkbox]), nav a, .button")]
    .filter(e => e.checkVisibility() && !e.matches(".block"))
    .filter(e => Math.min(e.getBoundingClientRect().height, e.getBoundingClientRect().width) < least)
    .map(e => e.outerHTML)"""
#: Words that stand on two lines, and buttons that do not hold their words.
BROKEN = r"""() => {
    const wrong = [];
    const buttons = "button, .button, nav a, .brand, .pill";
    const where = `${buttons}, h1, h2, dt, dd, p, figcaption, legend, label > span, .state-word`;
    for (const element of document.querySelectorAll(where)) {
        if (!element.checkVisibility({ visibilityProperty: true })) continue;
        if (element.matches(buttons) && !element.matches(".block, .unseen")
            && element.scrollWidth > element.clientWidth + 1) wrong.push("cut off: " + element.outerHTML);
        const texts = document.createTreeWalker(element, NodeFilter.SHOW_TEXT);
        while (texts.nextNode()) {
            const text = texts.currentNode;
            if (text.parentElement.closest(".unseen, .cover")) continue;
            for (const word of text.data.matchAll(/[\p{L}\p{N}]+/gu)) {
                const range = document.createRange();
                range.setStart(text, word.index);
                range.setEnd(text, word.index + word[0].length);
                const lines = new Set([...range.getClientRects()].map(({ top }) => Math.round(top)));
                if (lines.size > 1) wrong.push(`broken: ${word[0]}: ${element.outerHTML.slice(0, 200)}`);
            }
        }
    }
    return wrong;
}"""


def enter(page: Page, panel: Panel, view: str) -> None:
    """Go to a view, and wait until it has what it shows."""
    page.goto(f"{panel.url}/#/{view}")
    expect(page.locator(f":is({READY[view]}):visible").first).to_be_attached()
    if view == "doctor":
        page.locator("#doctor-run").click()
        expect(page.locator(".finding")).to_have_count(2)


def assert_fits_a_phone(page: Page) -> None:
    """A phone 360 px wide scrolls down only, breaks no word, and has nothing that a finger fails to hit."""
    scrolled, broken = page.evaluate("document.documentElement.scrollWidth"), page.evaluate(BROKEN)
    too_small = page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX)
    assert (scrolled, broken, too_small) == (360, [], []), (scrolled, broken, too_small)
