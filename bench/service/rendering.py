"""Measures how long a browser takes to draw the pages that have to do with many jumps."""

from statistics import median
from typing import Any, Final

from bench.service.browser import Browser, Drawn, browser
from bench.service.serving import ServedRig

_REPEATS: Final = 5
_NEWEST: Final = "jump-1999"
#: By name: the address behind the service's, and what is true once the page is drawn.
_PAGES: Final = {
    "list": ("#/recordings", 'document.querySelectorAll("#recordings-list a").length > 50'),
    "athlete's page": ("#/athlete/anna%20berg", 'document.querySelectorAll("#athlete-table tbody tr").length >= 60'),
    "table of a day": ("#/jumps/2026-02-01", 'document.querySelectorAll("#day-table tbody tr").length === 50'),
    "jump's page, with what to compare": (
        f"#/recordings/{_NEWEST}",
        'document.querySelectorAll("#compare option").length === 100',
    ),
    "coach's screen": ("#/coach", 'document.querySelector("#coach-replay")?.dataset.stage === "ready"'),
    "athlete's phone": (f"#/jump/{_NEWEST}", 'document.querySelector("#visit-replay")?.dataset.stage === "ready"'),
}


def rendered(service: ServedRig, jumps: int) -> list[dict[str, Any]]:
    """Draw each page several times, each time as one that comes for the first time.

    Args:
        service: with the jumps.
        jumps: how many it has.

    Returns:
        A case for each page: the median time until it is drawn, and how long the page's thread computes of it; none if
        the computer has no browser.
    """
    with browser() as opened:
        if opened is None:
            return []
        return [_case(opened, service, name, *page, jumps) for name, page in _PAGES.items()]


def _case(opened: Browser, service: ServedRig, name: str, path: str, ready: str, jumps: int) -> dict[str, Any]:
    seen = [opened.drawn(f"{service.url}/{path}", ready) for _ in range(_REPEATS)]
    return {
        "name": f"{name} in a browser, of {jumps}", "unit": "ms", "value": _middle(seen, "ms"),
        "baseline_is": "computed in the browser", "baseline": _middle(seen, "cpu_ms"),
    }  # fmt: skip


def _middle(seen: list[Drawn], name: str) -> float:
    return round(float(median(getattr(each, name) for each in seen)), 1)
