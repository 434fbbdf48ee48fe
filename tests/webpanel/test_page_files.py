"""The page's files, as the package holds them."""

from importlib.resources import files
from pathlib import Path

import httpx

PAGE = Path(str(files("webpanel"))) / "page"
TYPES = {
    ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml",
    ".json": "application/json", ".webmanifest": "application/manifest+json", ".png": "image/png",
}  # fmt: skip


def test_every_file_is_served_with_its_type(client: httpx.Client) -> None:
    found = [path for path in PAGE.rglob("*") if path.is_file()]
    assert found
    for path in found:
        answer = client.get(f"/{path.relative_to(PAGE)}")
        assert answer.status_code == 200, path
        assert answer.content == path.read_bytes()
        assert answer.headers["content-type"].split(";")[0] == TYPES[path.suffix]


def test_the_page_stands_at_the_root(client: httpx.Client) -> None:
    assert client.get("/").content == (PAGE / "index.html").read_bytes()


def test_what_has_not_changed_is_not_sent_again(client: httpx.Client) -> None:
    tag = client.get("/").headers["etag"]
    again = client.get("/", headers={"If-None-Match": tag})
    assert (again.status_code, again.content) == (304, b"")


NO_FILES = ["/i18n", "/i18n/", "/live/", "/none.js", "/index.html/x", "/docs_page/index.html"]


def test_there_are_no_lists_of_files(client: httpx.Client) -> None:
    for path in NO_FILES:
        assert client.get(path, follow_redirects=True).status_code == 404
