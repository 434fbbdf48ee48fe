"""The browser of the benchmarks."""

import pytest

from bench.service.browser import browser

_PAGE = """data:text/html,<script>setTimeout(() => {
  const end = performance.now() + 50;
  while (performance.now() < end);
  document.body.id = "there";
}, 100)</script>"""


def test_it_tells_when_a_page_is_drawn_and_how_long_it_computed() -> None:
    with browser() as opened:
        if opened is None:
            pytest.skip("no browser (Debian package chromium-headless-shell)")
        for _ in range(2):  # each time as one that comes for the first time
            drawn = opened.drawn(_PAGE, "document.body?.id === 'there'")
            assert drawn.ms >= 150
            assert 50 <= drawn.cpu_ms <= drawn.ms
