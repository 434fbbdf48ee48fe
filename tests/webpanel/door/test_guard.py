"""Names, pages of other sites, tokens, bodies: what is refused before anything happens. Over a real socket."""

import logging
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, refused, serving
from webpanel.door.access import Access
from webpanel.door.roles import Role

TOKEN = "a-token-for-the-tests-only"  # noqa: S105
PEER = "127.0.0.1"  # from which the tests call, wherever the panel listens on loopback
BEARER = {"Authorization": f"Bearer {TOKEN}"}


@pytest.fixture
def locked(service: MemoryService, loopback: Loopback) -> Iterator[Panel]:
    """The panel with a token."""
    access = Access.for_address(loopback.host, environment={"SVEV_TOKEN": TOKEN})
    with serving(service, access) as running:
        yield running


@pytest.fixture
def stranger(locked: Panel) -> Iterator[httpx.Client]:
    """Somebody without the token."""
    with locked.client() as opened:
        yield opened


FOREIGN_NAMES = ["evil.org", "evil.org:8000", "127.0.0.1.evil.org", "", "192.168.1.1"]


def test_a_foreign_name_is_refused(client: httpx.Client) -> None:
    for host in FOREIGN_NAMES:
        for path in ("/", "/api/status", "/healthz", "/metrics", "/docs"):
            assert refused(client.get(path, headers={"Host": host}), 400).code == "unknown_host"
        refused(client.post("/api/arm", headers={"Host": host}), 400)
        assert client.get("/api/status").json()["state"] == "idle"


OWN_NAMES = ["localhost", "LOCALHOST:1234", "127.0.0.1", "[::1]:8000"]


def test_own_names_are_answered(client: httpx.Client) -> None:
    for name in OWN_NAMES:
        assert client.get("/api/status", headers={"Host": name}).status_code == 200, name


FOREIGN_PAGES = [
    {"Origin": "http://evil.org"},
    {"Origin": "null"},
    {"Origin": ""},
    {"Origin": "file://"},
    {"Origin": "http://[bad"},
    {"Origin": "http://localhost:1"},
    {"Sec-Fetch-Site": "cross-site"},
    {"Sec-Fetch-Site": "same-site"},
]


def test_pages_of_other_sites_change_nothing(client: httpx.Client) -> None:
    for headers in FOREIGN_PAGES:
        assert refused(client.post("/api/arm", headers=headers), 403).code == "foreign_origin"
        refused(client.post("/api/recordings", headers=headers, json={}), 403)
        refused(client.delete("/api/recordings/x", headers=headers), 403)
        refused(client.patch("/api/recordings/x", headers=headers, json={}), 403)
        refused(client.get("/api/preview.mjpg", headers=headers), 403)
        assert client.get("/api/status").json()["state"] == "idle"


def test_the_own_page_may_change_things(panel: Panel, client: httpx.Client) -> None:
    own = {"Origin": panel.url, "Sec-Fetch-Site": "same-origin"}
    assert client.post("/api/arm", headers=own).status_code == 200


def test_every_answer_is_guarded(client: httpx.Client) -> None:
    for path in ("/", "/api/status", "/api/nothing", "/metrics", "/docs", "/digitize.html"):
        headers = client.get(path).headers
        assert headers["content-security-policy"].startswith("default-src 'none'; ")
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert "access-control-allow-origin" not in headers
        assert "server" not in headers
    assert "'unsafe" not in client.get("/").headers["content-security-policy"]
    assert client.get("/api/status").headers["cache-control"] == "no-store"
    assert client.get("/").headers["cache-control"] == "no-cache"


def test_without_the_token_only_the_page_is_seen(stranger: httpx.Client) -> None:
    for path in ("/api/status", "/api/recordings", "/api/events", "/api/preview.mjpg", "/api/rig", "/metrics", "/docs"):
        answer = stranger.get(path)
        assert refused(answer, 401).code == "login_required"
        assert answer.headers["www-authenticate"] == "Bearer"
    refused(stranger.post("/api/arm"), 401)
    refused(stranger.get("/api/recordings/x/file"), 401)
    refused(stranger.get("/openapi.json"), 401)
    assert stranger.get("/").status_code == 200
    assert stranger.get("/healthz").status_code == 200


DETOURS = [
    "//api/status",
    "/./api/status",
    "/%61pi/status",
    "/x/../api/status",
    "/API/status",
    "/api//status",
    "http://localhost/api/status",
]


def test_no_detour_leads_around_the_token(locked: Panel) -> None:
    for path in DETOURS:
        with locked.connect() as raw:
            raw.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
            answer = b"".join(iter(lambda: raw.recv(65536), b""))
        assert answer.split()[1] in {b"401", b"404"}, path
        assert b"cameras" not in answer, path


def test_with_the_token_everything_works(stranger: httpx.Client) -> None:
    assert stranger.get("/api/status", headers=BEARER).status_code == 200
    assert stranger.get("/metrics", headers={"authorization": f"bearer  {TOKEN}"}).status_code == 200
    assert stranger.post("/api/arm", headers=BEARER).status_code == 200


WRONG_TOKENS = ["Bearer wrong", "Bearer", TOKEN, f"Basic {TOKEN}", f"Bearer {TOKEN} x"]


def test_wrong_tokens(stranger: httpx.Client) -> None:
    for value in WRONG_TOKENS:
        refused(stranger.get("/api/status", headers={"Authorization": value}), 401)


def test_a_token_in_the_address_opens_nothing(stranger: httpx.Client) -> None:
    refused(stranger.get(f"/api/status?token={TOKEN}"), 401)
    refused(stranger.post(f"/api/login?token={TOKEN}", json={"token": TOKEN}), 422)


def test_the_page_logs_in_once(stranger: httpx.Client) -> None:
    answer = stranger.post("/api/login", json={"token": TOKEN})
    assert answer.status_code == 204
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert "Path=/" in cookie
    assert TOKEN not in cookie
    assert stranger.get("/api/status").status_code == 200
    key = stranger.cookies["svev_session"]
    assert stranger.post("/api/logout").status_code == 204
    assert "svev_session" not in stranger.cookies
    refused(stranger.get("/api/status"), 401)
    refused(stranger.get("/api/status", headers={"Cookie": f"svev_session={key}"}), 401)


def test_a_session_does_not_help_another_site(stranger: httpx.Client) -> None:
    stranger.post("/api/login", json={"token": TOKEN})
    refused(stranger.post("/api/arm", headers={"Origin": "http://evil.org"}), 403)


def test_who_guesses_must_wait_and_the_right_token_passes(locked: Panel, stranger: httpx.Client) -> None:
    for guess in range(10):
        assert refused(stranger.post("/api/login", json={"token": f"guess {guess}"}), 401).code == "wrong_token"
    answer = stranger.post("/api/login", json={"token": "guess 10"})
    assert refused(answer, 429).code == "too_many_wrong_tokens"
    assert 0 < int(answer.headers["retry-after"]) <= 60
    refused(stranger.get("/api/status", headers={"Authorization": "Bearer guess"}), 429)
    # The same address, as behind one router: who has the token gets in.
    assert stranger.get("/api/status", headers=BEARER).status_code == 200
    assert stranger.post("/api/login", json={"token": TOKEN}).status_code == 204
    told = [event.message for event in locked.service.events(0) if event.level == "warning"]
    assert [text.partition(":")[0] for text in told] == [
        f"wrong token from {PEER}", f"10 wrong tokens from {PEER} within a minute",
    ]  # fmt: skip


def test_the_cookie_is_for_https_alone_behind_a_proxy_that_says_so(service: MemoryService, loopback: Loopback) -> None:
    cookies = []
    for proxies in ([PEER], []):
        access = Access.for_address(loopback.host, environment={"SVEV_TOKEN": TOKEN}, proxies=proxies)
        with serving(service, access) as panel, panel.client() as client:
            headers = {"X-Forwarded-Proto": "https", "X-Forwarded-For": "192.0.2.7"}
            cookies.append(client.post("/api/login", json={"token": TOKEN}, headers=headers).headers["set-cookie"])
    assert ["Secure" in cookie for cookie in cookies] == [True, False]
    told = [event.message for event in service.events(0)]
    assert told == ["logged in (administer, 192.0.2.7)", f"logged in (administer, {PEER})"]


ROLE_TOKENS = {role: f"the-token-to-{role}-with" for role in Role}
CALLS = [
    ("GET", "/api/status", Role.WATCH),
    ("GET", "/metrics", Role.WATCH),
    ("POST", "/api/arm", Role.OPERATE),
    ("PATCH", "/api/cameras/K1", Role.OPERATE),  # whatever it says, `save` too
    ("PATCH", "/api/trigger", Role.OPERATE),
    ("PATCH", "/api/next-jumper", Role.OPERATE),
    ("POST", "/api/recordings", Role.OPERATE),
    ("PATCH", "/api/recordings/jump", Role.OPERATE),
    ("DELETE", "/api/recordings/jump/notes/1", Role.OPERATE),
    ("DELETE", "/api/recordings/jump", Role.ADMINISTER),
    ("POST", "/api/recordings/jump/restore", Role.ADMINISTER),
    ("DELETE", "/api/trash", Role.ADMINISTER),
    ("POST", "/api/rig", Role.ADMINISTER),
]


def test_a_role_may_do_what_is_its_own(service: MemoryService, loopback: Loopback, tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    file.write_text("".join(f"{role} {token}\n" for role, token in ROLE_TOKENS.items()))
    write_recording(service.catalogue.directory, "jump")
    with serving(service, Access.for_address(loopback.host, file)) as panel, panel.client() as client:
        for role in Role:
            headers = {"Authorization": f"Bearer {ROLE_TOKENS[role]}"}
            own = client.get("/api/access", headers=headers).json()
            assert own == {"role": role, "logged_in": False}
            for method, path, needed in CALLS:
                answer = client.request(method, path, json=None if method == "GET" else {}, headers=headers)
                if role.may(needed):
                    assert answer.status_code != 403, (role, method, path)
                else:
                    problem = refused(answer, 403)
                    assert problem.code == "role_forbids"
                    assert f"may only {role}, and this needs one that may {needed}" in problem.detail
        assert client.post("/api/login", json={"token": ROLE_TOKENS[Role.OPERATE]}).status_code == 204
        assert client.get("/api/access").json() == {"role": "operate", "logged_in": True}
        refused(client.delete("/api/recordings/jump"), 403)
    told = [event.message for event in service.events(0)]
    for text in (
        f"armed the rig (operate, {PEER})", f"started a recording (operate, {PEER})",
        f"edited recording jump (operate, {PEER})", f"deleted recording jump (administer, {PEER})",
        f"logged in (operate, {PEER})",
    ):  # fmt: skip
        assert text in told
    assert not [text for text in told if "(watch" in text]


def test_tokens_stand_in_no_log(stranger: httpx.Client, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        stranger.get(f"/api/status?token={TOKEN}")
        stranger.post("/api/login", json={"token": TOKEN})
        stranger.get("/api/status", headers=BEARER)
        stranger.post("/api/login", json={"token": [TOKEN]})
    ours = [record.getMessage() for record in caplog.records if not record.name.startswith(("httpx", "httpcore"))]
    assert not any(TOKEN in message for message in ours)


def test_the_refusal_does_not_repeat_the_token(stranger: httpx.Client) -> None:
    assert TOKEN not in stranger.post("/api/login", json={"token": [TOKEN], TOKEN: 1}).text.replace(f"body.{TOKEN}", "")


def test_a_huge_body_where_none_belongs(
    client: httpx.Client, service: MemoryService, caplog: pytest.LogCaptureFixture
) -> None:
    def pieces() -> Iterator[bytes]:
        for _ in range(100):
            yield b"x" * 1000

    for path in ("/api/status", "/api/events"):
        with client.stream("GET", path, content=pieces()) as answer:
            assert answer.status_code == 200
            list(answer.iter_raw() if path.endswith("status") else ())
    assert client.get("/api/status").status_code == 200
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]


def test_huge_bodies(client: httpx.Client) -> None:
    client.post("/api/arm")
    assert refused(client.post("/api/recordings", json={"notes": "x" * 70_000}), 413).code == "request_entity_too_large"
    refused(client.post("/api/arm", json={"notes": "x" * 70_000}), 413)
    refused(client.post("/api/login", json={"token": "x" * 70_000}), 413)

    def pieces() -> Iterator[bytes]:
        yield b'{"notes": "'
        for _ in range(100):
            yield b"x" * 1000

    answer = client.post("/api/recordings", content=pieces(), headers={"Content-Type": "application/json"})
    refused(answer, 413)
    assert client.get("/api/status").json()["state"] == "armed"


FOREIGN_TYPES = [
    "text/plain",
    "application/x-www-form-urlencoded",
    "multipart/form-data; boundary=x",
    "",
]


def test_what_is_not_json_is_refused(client: httpx.Client) -> None:
    for media_type in FOREIGN_TYPES:
        client.post("/api/arm")
        for method, path in (("POST", "/api/recordings"), ("PATCH", "/api/recordings/x"), ("POST", "/api/arm")):
            answer = client.request(method, path, content=b"{}", headers={"Content-Type": media_type})
            assert refused(answer, 415).code == "unsupported_media_type"


WAYS_OUT = [
    "/../../etc/passwd",
    "/%2e%2e/%2e%2e/etc/passwd",
    "/..%2f..%2fetc/passwd",
    "/..%5c..%5cetc/passwd",
    "//etc/passwd",
    "/i18n/../../app.py",
    "/%00",
    "/index.html%00.js",
    "/__init__.py",
    "/../app.py",
    "/api/recordings/..%2f..%2fsecret/file",
    "/api/recordings/%2e%2e/file",
    "/api/recordings/.trash/file",
    "/api/recordings/.trash%2fjump/file",
    "/api/recordings/jump%00/file",
    "/api/recordings/jump%0d%0aX-Evil:1/file",
    "/api/recordings/" + "a" * 5000 + "/file",
]


def test_no_path_leads_out(panel: Panel, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "jump")
    (service.catalogue.directory.parent / "secret.mcap").write_text("secret")
    for path in WAYS_OUT:
        with panel.connect() as raw:
            raw.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
            answer = b"".join(iter(lambda: raw.recv(65536), b""))
        assert answer.split()[1] in {b"404", b"422"}, answer
        assert b"application/problem+json" in answer, path
        assert b"root:" not in answer, path
        assert b"X-Evil" not in answer.partition(b"\r\n\r\n")[0], path
