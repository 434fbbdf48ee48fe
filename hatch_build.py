"""Makes the README of the package: an index shows it alone, so its links lead to the repository in the web."""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?://)([^)]+)\)")


def on_an_index(readme: str, home: str) -> str:
    """A README as an index shows it.

    Args:
        readme: in Markdown, with links relative to the repository.
        home: address of the repository in the web; empty: it has none, and relative links become their words.
    """

    def absolute(link: re.Match[str]) -> str:
        picture, words, target = link.groups()
        if not home:
            return f"*{words}*" if picture else words
        return f"{picture}[{words}]({home}/{'raw' if picture else 'blob'}/main/{target})"

    return _LINK.sub(absolute, readme)


class PackageReadme(MetadataHookInterface):
    """Sets `readme` and `urls` of the package; `home` is set in pyproject.toml."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by hatchling."""
        home = self.config["home"].rstrip("/")
        text = on_an_index((Path(self.root) / "README.md").read_text(encoding="utf-8"), home)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        pages = {
            "Documentation": "/blob/main/docs/index.md",
            "Changelog": "/blob/main/CHANGELOG.md",
            "Issues": "/issues",
        }
        metadata["urls"] = {"Homepage": home, **{name: home + page for name, page in pages.items()}} if home else {}
