"""The index of messages in `docs/how-to/troubleshooting.md`, made from the headings of the pages beside it.

`python -m tests.support.message_index` writes it anew; a test compares it with the page.
"""

import re
from pathlib import Path
from typing import Final

PAGE: Final = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "troubleshooting.md"
PARTS: Final = sorted(PAGE.with_suffix("").glob("*.md"))
_BEGIN: Final = "<!-- all messages: written by python -m tests.support.message_index, do not edit -->"
_END: Final = "<!-- end of all messages -->"


def messages() -> list[tuple[str, Path]]:
    """Every message that a page explains, with its page, by its first words."""
    found = [(words, part) for part in PARTS for words in re.findall(r"^### `(.*)`$", part.read_text(), re.MULTILINE)]
    return sorted(found, key=lambda each: (re.sub(r"\W+", " ", each[0]).strip().casefold(), each[1]))


def anchor(heading: str) -> str:
    """The anchor that GitHub gives to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def index() -> str:
    """A list of all messages, in Markdown, with links."""
    return "".join(f"- [`{words}`]({part.relative_to(PAGE.parent)}#{anchor(words)})\n" for words, part in messages())


def shown() -> str:
    """The list as the page shows it."""
    return PAGE.read_text().partition(f"{_BEGIN}\n\n")[2].partition(f"\n{_END}")[0]


def write() -> None:
    """Write the list into the page."""
    before, after = PAGE.read_text().partition(_BEGIN)[0], PAGE.read_text().partition(_END)[2]
    PAGE.write_text(f"{before}{_BEGIN}\n\n{index()}\n{_END}{after}")


if __name__ == "__main__":
    write()
