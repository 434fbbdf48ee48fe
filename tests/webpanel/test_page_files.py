"""The page's files: documents at the root, all others at addresses that name their version."""

import re
from importlib.resources import files
from pathlib import Path

import httpx
import pytest

from webpanel.page_files import Page

PAGE = Path(str(files("webpanel"))) / "page"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


def place_of(client: httpx.Client) -> str:
    """Where the page names its modules: `/page/VERSION`."""
    found = re.search(r'src="\.(/page/[0-9a-f]+)/main\.js"', client.get("/").text)
    assert found
    return found[1]


def test_every_file_is_served_with_its_type_and_kept_by_browsers(client: httpx.Client) -> None:
    found = [path for path in PAGE.rglob("*") if path.is_file()]
    assert {path.suffix for path in found} == set(TYPES)
    place = place_of(client)
    for path in found:
        document = path.suffix == ".html"
        answer = client.get(f"{'' if document else place}/{path.relative_to(PAGE)}")
        assert answer.status_code == 200, path
        assert answer.headers["content-type"].split(";")[0] == TYPES[path.suffix]
        if document:
            assert answer.headers["cache-control"] == "no-cache"
        else:
            assert answer.content == path.read_bytes()
            assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"


def test_documents_name_what_they_load_by_its_version(client: httpx.Client) -> None:
    for document in ("/", "/digitize.html"):
        text = client.get(document).text
        named = re.findall(r'<(?:script|link|img|use)\b[^>]*? (?:src|href)="\.([^"#]+)', text)
        assert len(named) > 4
        for path in named:
            assert path.startswith("/page/")
            assert client.get(path).status_code == 200, path


def test_files_are_sent_packed_to_whom_can_unpack_them(client: httpx.Client) -> None:
    path = f"{place_of(client)}/main.js"
    for accepted in ("gzip, deflate, br", "identity"):
        answer = client.get(path, headers={"Accept-Encoding": accepted})
        assert answer.headers.get("content-encoding") == ("gzip" if "gzip" in accepted else None)
        assert answer.headers["vary"] == "Accept-Encoding"
        assert answer.content == (PAGE / "main.js").read_bytes()
    packed = int(client.get(path).headers["content-length"])
    assert packed < 0.5 * (PAGE / "main.js").stat().st_size
    head = client.head(path)
    assert (head.content, int(head.headers["content-length"])) == (b"", packed)


def test_a_document_that_has_not_changed_is_not_sent_again(client: httpx.Client) -> None:
    tag = client.get("/").headers["etag"]
    again = client.get("/", headers={"If-None-Match": f'"other", W/{tag}'})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get("/", headers={"If-None-Match": '"other"'}).status_code == 200


@pytest.mark.parametrize("change", ["other content", "other name", "one more"])
def test_any_change_makes_another_version(tmp_path: Path, change: str) -> None:
    (tmp_path / "a.js").write_text("1")
    before = Page(tmp_path)
    if change == "other content":
        (tmp_path / "a.js").write_text("2")
    elif change == "other name":
        (tmp_path / "a.js").rename(tmp_path / "b.js")
    else:
        (tmp_path / "b.css").write_text("")
    after = Page(tmp_path)
    assert after.version != before.version
    assert f"/page/{before.version}/a.js" in before  # what is served stays what it was
    assert f"/page/{before.version}/a.js" not in after


NO_FILES = ["/i18n", "/i18n/", "/live/", "/none.js", "/main.js", "/index.html/x", "/docs_page/index.html"]


def test_there_are_no_lists_of_files(client: httpx.Client) -> None:
    place = place_of(client)
    elsewhere = [place, f"{place}/", f"{place}/live", f"{place}/none.js", "/page/0123456789abcdef/main.js"]
    for path in [*NO_FILES, *elsewhere]:
        assert client.get(path, follow_redirects=True).status_code == 404
