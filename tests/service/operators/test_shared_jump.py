"""Who has logged in, and who has the link to a jump, goes on after a restart of the service; other tokens end both."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig

pytestmark = pytest.mark.long

TOKENS = ("a-token-of-this-test-alone", "another-token-of-this-test")


@contextmanager
def _started(folder: Path, loopback: Loopback, token: str) -> Iterator[Serving]:
    """The service behind a proxy, which phones reach as `hillpc.local`."""
    rig = write_rig(folder, loopback, backend="sim")
    options = ("--allow-host", "hillpc.local", "--proxy", "127.0.0.1")
    with serving(folder, rig, loopback, *options, environment={"SVEV_TOKEN": token}, token=token) as service:
        yield service


def test_logins_and_links_outlive_the_service(tmp_path: Path, loopback: Loopback) -> None:
    with _started(tmp_path, loopback, TOKENS[0]) as service:
        service.arm()
        recording = service.post("/api/recordings", {"duration_s": 0})["id"]
        service.await_state("armed")
        with httpx.Client(base_url=service.url, headers={"Host": "hillpc.local:8000"}, timeout=20) as screen:
            assert screen.post("/api/login", json={"token": TOKENS[0]}).status_code == 204
            session = dict(screen.cookies)
            link = screen.get(f"/api/recordings/{recording}/link").json()["link"]
        assert link.startswith(f"http://hillpc.local:8000/#/jump/{recording}/")
        with httpx.Client(base_url=service.url, timeout=20) as phone:
            given = {"recording": recording, "key": link.rpartition("/")[2]}
            assert phone.post("/api/login/link", json=given).status_code == 200
            visit = {"svev_link": given["key"]}
        said = service.log.read_text()
        assert given["key"] not in said
        assert session["svev_session"] not in said
    for token, expected in ((TOKENS[0], 200), (TOKENS[1], 401)):
        with _started(tmp_path, loopback, token) as service:
            for cookies, path in ((session, "/api/status"), (visit, f"/api/recordings/{recording}")):
                with httpx.Client(base_url=service.url, cookies=cookies, timeout=20) as again:
                    assert again.get(path).status_code == expected, (token, path)
                    if cookies is visit:
                        assert again.get("/api/status").status_code == 401
