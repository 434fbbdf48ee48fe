"""The documentation as a site: every page is in its navigation, and it is read without a network."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.rest_description import write
from tests.test_docs import PAGES, ROOT

_CONFIG = ROOT / ".ci" / "docs" / "mkdocs.yml"
_MKDOCS = ROOT / "build" / "docs" / "env" / "bin" / "mkdocs"


def test_every_page_is_in_the_navigation_or_in_an_index() -> None:
    named = set(re.findall(r"[\w/-]+\.md", _CONFIG.read_text().partition("\nnav:\n")[2]))
    docs = ROOT / "docs"
    pages = {str(page.relative_to(docs)) for page in PAGES if docs in page.parents}
    apart = {page for page in pages if re.match(r"decisions/0", page)}
    made = {"readme.md", "contributing.md", "changelog.md", "reference/rest-calls.md", "reference/python.md"}
    assert named == (pages - apart) | made


@pytest.mark.long
@pytest.mark.skipif(not _MKDOCS.exists(), reason="mkdocs is not there: make docs")
def test_the_site_is_whole_and_fetches_nothing_from_elsewhere(tmp_path: Path) -> None:
    described = tmp_path / "build" / "docs" / "openapi.json"
    described.parent.mkdir(parents=True)
    write(described)
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, tmp_path)
    for name in ("docs", ".ci", "photogrammetry", "rig"):
        shutil.copytree(ROOT / name, tmp_path / name)
    build = [str(_MKDOCS), "build", "--strict", "--config-file", str(tmp_path / ".ci" / "docs" / "mkdocs.yml")]
    done = subprocess.run(build, check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    site = tmp_path / "build" / "site"
    for page in site.rglob("*.html"):
        text = page.read_text()
        assert not re.findall(r"<(?:script|img|iframe|source)[^>]*src=\"?(?:https?:)?//", text), page
        assert not re.findall(r"<link[^>]*(?:stylesheet|preconnect|icon)[^>]*href=\"?(?:https?:)?//", text), page
    index = json.loads((site / "search" / "search_index.json").read_text())
    assert {"reference/rest-calls.html", "reference/python.html", "how-to/measuring.html"} <= {
        entry["location"] for entry in index["docs"]
    }
    assert "photogrammetry.intersect_points" in (site / "reference" / "python.html").read_text()
    assert "POST /api/recordings" in (site / "reference" / "rest-calls.html").read_text()
