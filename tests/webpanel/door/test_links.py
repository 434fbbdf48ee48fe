"""A link opens one recording, shows of it what it may, ends, and opens nothing else. Over a real socket."""

import logging
import stat
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import cv2
import httpx
import numpy as np
import pytest
from starlette.requests import Request

from rig.api.status import State
from tests.browser.conftest import MEASURED, keep_measured
from tests.recorder.logs import ALL_OK
from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, refused, serving
from webpanel.door.access import Access
from webpanel.door.link_file import NAME, LinkFile
from webpanel.door.links import SECRET_NAME, Links, kept_secret
from webpanel.door.roles import Role, needed_role
from webpanel.door.tokens import Tokens
from webpanel.routes.links import address_for_phones, qr_svg

TOKEN = "a-token-for-the-tests-only"  # noqa: S105
BEARER = {"Authorization": f"Bearer {TOKEN}"}
HOUR_S = 3600.0
#: A name as phones call the service, on this computer.
PHONES = "hillpc.local"
#: An id with what addresses write otherwise.
ODD = "Åse (2) 50%! jump's"


@dataclass
class Clock:
    """A clock that stands still until it is set."""

    now: float = 1.8e9

    def __call__(self) -> float:
        """UNIX time, s."""
        return self.now


@dataclass
class Shared:
    """A panel that phones reach, and the clock of its links."""

    panel: Panel
    clock: Clock

    def phone(self) -> httpx.Client:
        """Somebody without a token; close it."""
        return self.panel.client()

    def link(self, recording: str) -> str:
        """A link, as the coach's screen shows it."""
        with self.panel.client(headers=BEARER | {"Host": f"{PHONES}:8000"}) as coach:
            answer = coach.get(f"/api/recordings/{recording}/link")
        assert answer.status_code == 200, answer.text
        link: str = answer.json()["link"]
        return link

    @contextmanager
    def opened(self, recording: str) -> Iterator[httpx.Client]:
        """A phone that has opened a link."""
        name, key = _parts(self.link(recording))
        with self.phone() as phone:
            answer = phone.post("/api/login/link", json={"recording": name, "key": key})
            assert answer.status_code == 200, answer.text
            yield phone


def _parts(link: str) -> tuple[str, str]:
    """Id and key of a link."""
    page, name, key = link.partition("/#/")[2].split("/")
    assert page == "jump"
    return unquote(name), key


@contextmanager
def sharing(
    service: MemoryService, host: str, secret: bytes = b"s" * 32, token: str = TOKEN, file: LinkFile | None = None
) -> Iterator[Shared]:
    """Serve meanwhile, on loopback behind a proxy, as phones in the network would see it."""
    access = Access.for_address(host, None, [PHONES], {"SVEV_TOKEN": token}, proxies=["127.0.0.1"])
    clock = Clock()
    with serving(service, access, links=Links(secret, access.tokens, HOUR_S, clock, file)) as panel:
        yield Shared(panel, clock)


@pytest.fixture
def shared(service: MemoryService, loopback: Loopback) -> Iterator[Shared]:
    """Two measured jumps, and somebody who has links."""
    folder = service.catalogue.directory
    told = {"athlete": "Anna Berg", "bib": "17", "notes": "sore knee", "operator": "Kari"}
    for name in ("jump-1", "jump-2"):
        keep_measured(write_recording(folder, name, (ALL_OK,) * 5, told), (MEASURED,))
    with sharing(service, loopback.host) as running:
        yield running


#: What the page of a jump needs.
SHOWN = ("", "/measurement?jumps=false", "/measurement/files/report.html", "/pulses", "/pulses/1.jpg?width=64",
         "/moment", "/thumbnail.jpg")  # fmt: skip
#: What a link does not open of its own recording.
HIDDEN = (
    "/file",
    "/file.sha256",
    "/notes",
    "/voice-notes",
    "/pulses/1.png",
    "/link",
    "/links",
    "/exports",
    "/measurement/files/jumper.json",
)


def test_a_link_opens_the_page_of_its_jump(shared: Shared) -> None:
    with shared.opened("jump-1") as phone:
        for part in SHOWN:
            answer = phone.get(f"/api/recordings/jump-1{part}")
            assert answer.status_code == 200, (part, answer.text)
            assert phone.head(f"/api/recordings/jump-1{part}").status_code == 200
        # A browser does not send the cookie there.
        versioned = "/api/v1/recordings/jump-1"
        refused(phone.get(versioned), 401)
        cookie = {"Cookie": f"svev_link={phone.cookies['svev_link']}"}
        assert phone.get(versioned, headers=cookie).json()["session"]["bib"] == "17"


def test_what_was_noted_about_the_athlete_is_not_shown(shared: Shared) -> None:
    with shared.opened("jump-1") as phone, shared.panel.client(headers=BEARER) as coach:
        session = phone.get("/api/recordings/jump-1").json()["session"]
        assert (session["athlete"], session["notes"], session["operator"]) == ("Anna Berg", "", "")
        assert coach.get("/api/recordings/jump-1").json()["session"]["notes"] == "sore knee"
        files = phone.get("/api/recordings/jump-1/measurement?jumps=false").json()["files"]
        assert "report.html" in files
        assert "jumper.json" not in files  # which has the whole session
        assert "jumper.json" in coach.get("/api/recordings/jump-1/measurement?jumps=false").json()["files"]


def test_a_link_opens_nothing_else_of_its_recording_and_changes_nothing(shared: Shared) -> None:
    with shared.opened("jump-1") as phone:
        for part in HIDDEN:
            assert refused(phone.get(f"/api/recordings/jump-1{part}"), 403).code == "link_forbids", part
        for method, part in (
            ("PATCH", ""), ("DELETE", ""), ("POST", "/stop"), ("POST", "/restore"), ("POST", "/measurement"),
            ("DELETE", "/measurement"), ("DELETE", "/links/1"),
            ("POST", "/exports"), ("PUT", "/notes/1"), ("POST", "/voice-notes?pulse=1"),
            ("OPTIONS", ""), ("TRACE", ""), ("GETX", ""),
        ):  # fmt: skip
            refused(phone.request(method, f"/api/recordings/jump-1{part}", json={}), 403)
    assert not shared.panel.service.recording("jump-1").deleted


EVERYWHERE = ("/api/status", "/api/recordings", "/api/events", "/api/preview.jpg", "/api/preview.mjpg", "/api/rig",
              "/api/trash", "/api/exports", "/api/start-list", "/api/next-jumper", "/api/access", "/api/doctor",
              "/api/recordings.zip?ids=jump-1", "/api/cameras/K1", "/metrics", "/docs", "/openapi.json")  # fmt: skip


def test_a_link_opens_no_other_recording_and_no_other_call(shared: Shared) -> None:
    with shared.opened("jump-1") as phone:
        stolen = {"Cookie": f"svev_link={phone.cookies['svev_link']}"}
        for path in (*EVERYWHERE, *(f"/api/recordings/jump-2{part}" for part in (*SHOWN, *HIDDEN))):
            refused(phone.get(path), 401)
            refused(phone.get(path, headers=stolen), 401)  # a browser would not send it there
        for path in ("/api/arm", "/api/recordings", "/api/mark"):
            refused(phone.post(path, json={}, headers=stolen), 401)


DETOURS = ("jump-1/../jump-2", "jump-1/%2e%2e/jump-2", "jump-1%2f..%2fjump-2", "jump-2?/jump-1", "jump-1%00/../jump-2",
           "jump-1/../../status", "jump-1/measurement/../../jump-2", "jump-1//measurement", "jump-1/measurement/",
           "jump-1/measurement/files/..%2f..%2fjump-2.mcap", "jump-1/measurement/files/%2e%2e",
           "jump-1/pulses/1.jpg/../../file", "jump-1/", "./jump-2", "jump-1%0a")  # fmt: skip


def test_no_detour_leads_out_of_the_jump(shared: Shared) -> None:
    _, key = _parts(shared.link("jump-1"))
    for path in DETOURS:
        with shared.panel.connect() as raw:
            request = f"GET /api/recordings/{path} HTTP/1.1\r\nHost: {PHONES}\r\nCookie: svev_link={key}\r\n"
            raw.sendall(f"{request}Connection: close\r\n\r\n".encode())
            answer = b"".join(iter(lambda: raw.recv(65536), b""))
        assert answer.split()[1] in {b"400", b"401", b"403", b"404", b"422"}, (path, answer[:200])
        assert b"jump-2.mcap" not in answer, path


def test_a_key_is_a_key_of_nothing_but_its_link(shared: Shared) -> None:
    _, key = _parts(shared.link("jump-1"))
    with shared.phone() as phone:
        refused(phone.get("/api/recordings/jump-1", headers={"Authorization": f"Bearer {key}"}), 401)
        refused(phone.get("/api/recordings/jump-1", headers={"Cookie": f"svev_session={key}"}), 401)
        refused(phone.get(f"/api/recordings/jump-1?key={key}"), 401)
        refused(phone.post("/api/login", json={"token": key}), 401)
        refused(phone.post("/api/login/link", json={"recording": "jump-2", "key": key}), 401)
        foreign = phone.post(
            "/api/login/link", json={"recording": "jump-1", "key": key}, headers={"Origin": "http://evil.org"}
        )
        assert refused(foreign, 403).code == "foreign_origin"


def test_a_tampered_key_opens_nothing(shared: Shared) -> None:
    _, key = _parts(shared.link("jump-1"))
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    tampered = {key[:at] + letter + key[at + 1 :] for at in range(len(key)) for letter in letters} - {key}
    links = Links(b"s" * 32, Tokens({TOKEN.encode(): Role.ADMINISTER}), HOUR_S, shared.clock)
    assert links.ends("jump-1", key) is not None
    assert not [each for each in tampered if links.ends("jump-1", each) is not None]
    for wrong in ("", "=" * 27, key[:-1], key + "A", "ø" * 27, "\udcff" * 27, "a b" * 9):
        assert links.ends("jump-1", wrong) is None
    assert links.ends("jump-1\udcff", key) is None
    with shared.phone() as phone:
        for wrong in sorted(tampered)[:: len(tampered) // 20]:
            answer = phone.post("/api/login/link", json={"recording": "jump-1", "key": wrong})
            assert refused(answer, 401).code == "wrong_link"
            refused(phone.get("/api/recordings/jump-1", headers={"Cookie": f"svev_link={wrong}"}), 401)
        refused(phone.post("/api/login/link", json={"recording": "jump-1", "key": key, "role": "administer"}), 422)


def test_a_link_ends_in_time(shared: Shared) -> None:
    _, key = _parts(shared.link("jump-1"))
    with shared.opened("jump-1") as phone:
        shared.clock.now += HOUR_S - 1
        assert phone.get("/api/recordings/jump-1").status_code == 200
        shared.clock.now += 61
        assert refused(phone.get("/api/recordings/jump-1"), 401).code == "link_ended"
        again = phone.post("/api/login/link", json={"recording": "jump-1", "key": key})
        assert refused(again, 401).code == "link_ended"


def test_a_link_works_on_after_a_restart_and_ends_with_the_tokens(service: MemoryService, loopback: Loopback) -> None:
    write_recording(service.catalogue.directory, "jump-1")
    with sharing(service, loopback.host) as before, before.opened("jump-1") as phone:
        cookie = {"Cookie": f"svev_link={phone.cookies['svev_link']}"}
    for secret, token, status in (
        (b"s" * 32, TOKEN, 200), (b"s" * 32, TOKEN + "2", 401), (b"t" * 32, TOKEN, 401),
    ):  # fmt: skip
        with sharing(service, loopback.host, secret, token) as again, again.phone() as visitor:
            assert visitor.get("/api/recordings/jump-1", headers=cookie).status_code == status


def _listed(shared: Shared, recording: str = "jump-1") -> list[int]:
    """The links that open a recording."""
    with shared.panel.client(headers=BEARER) as coach:
        return [each["number"] for each in coach.get(f"/api/recordings/{recording}/links").json()]


def _taken_back(shared: Shared, number: int, recording: str = "jump-1") -> httpx.Response:
    with shared.panel.client(headers=BEARER) as coach:
        return coach.delete(f"/api/recordings/{recording}/links/{number}")


def test_one_link_is_taken_back_and_no_other_one(shared: Shared) -> None:
    _, key = _parts(shared.link("jump-1"))
    with shared.opened("jump-1") as phone, shared.opened("jump-2") as other_jump:
        shared.clock.now += 180  # a code that is shown within two and a half minutes of an hour is the same link
        with shared.opened("jump-1") as later:
            first, second = _listed(shared)
            assert _taken_back(shared, first).status_code == 204
            for part in SHOWN:
                answer = phone.get(f"/api/recordings/jump-1{part}")
                assert refused(answer, 401).code == "link_taken_back", part
            again = phone.post("/api/login/link", json={"recording": "jump-1", "key": key})
            assert refused(again, 401).code == "link_taken_back"
            assert later.get("/api/recordings/jump-1").status_code == 200
            assert other_jump.get("/api/recordings/jump-2").status_code == 200
            assert _listed(shared) == [second]
            assert _taken_back(shared, second).status_code == 204
            refused(later.get("/api/recordings/jump-1"), 401)
    assert _parts(shared.link("jump-1"))[1] != key  # nor is the next one the same by chance of the clock
    with shared.opened("jump-1") as phone:
        assert phone.get("/api/recordings/jump-1").status_code == 200


def test_the_next_code_is_another_link_also_within_the_minute(shared: Shared) -> None:
    keys = set()
    for _ in range(3):
        keys.add(_parts(shared.link("jump-1"))[1])
        assert _parts(shared.link("jump-1"))[1] in keys
        (number,) = _listed(shared)
        assert _taken_back(shared, number).status_code == 204
    assert len(keys) == 3
    with shared.phone() as phone:
        for key in keys:
            refused(phone.get("/api/recordings/jump-1", headers={"Cookie": f"svev_link={key}"}), 401)


def test_nobody_takes_a_link_back_who_may_not(shared: Shared) -> None:
    with shared.opened("jump-1") as phone:
        (number,) = _listed(shared)
        path = f"/api/recordings/jump-1/links/{number}"
        assert refused(phone.delete(path), 403).code == "link_forbids"
        refused(phone.delete(f"/api/recordings/jump-2/links/{number}"), 401)
        foreign = {"Origin": "http://evil.org"} | BEARER
        with shared.panel.client() as site:
            assert refused(site.delete(path, headers=foreign), 403).code == "foreign_origin"
            refused(site.delete(path), 401)
        assert phone.get("/api/recordings/jump-1").status_code == 200
    assert _listed(shared) == [number]
    assert needed_role("DELETE", path) is Role.OPERATE


def test_only_a_link_that_is_open_is_taken_back(shared: Shared) -> None:
    shared.link("jump-1")
    (number,) = _listed(shared)
    for wrong in (number + 1, 0, 2**32 - 1):
        assert refused(_taken_back(shared, wrong), 404).code == "unknown_link"
    assert refused(_taken_back(shared, number, "jump-2"), 404).code == "unknown_link"
    refused(_taken_back(shared, number, "nobody"), 404)
    for wrong in (-1, 2**32):
        refused(_taken_back(shared, wrong), 422)
    assert _taken_back(shared, number).status_code == 204
    assert refused(_taken_back(shared, number), 404).code == "unknown_link"
    shared.link("jump-2")
    shared.clock.now += 2 * HOUR_S
    assert _listed(shared, "jump-2") == []


def test_what_was_taken_back_stays_so_after_a_restart(service: MemoryService, loopback: Loopback) -> None:
    folder, told = service.catalogue.directory, []
    write_recording(folder, "jump-1")

    def served() -> AbstractContextManager[Shared]:
        return sharing(service, loopback.host, file=LinkFile(folder, lambda said: told.append(said.code)))

    with served() as before, before.opened("jump-1") as phone:
        stolen = {"Cookie": f"svev_link={phone.cookies['svev_link']}"}
        (number,) = _listed(before)
        assert _taken_back(before, number).status_code == 204
        good = {"Cookie": f"svev_link={_parts(before.link('jump-1'))[1]}"}
    with served() as after, after.phone() as phone:
        assert refused(phone.get("/api/recordings/jump-1", headers=stolen), 401).code == "link_taken_back"
        assert phone.get("/api/recordings/jump-1", headers=good).status_code == 200
        assert len(_listed(after)) == 1
        assert told == []
        (folder / NAME).unlink()
        (folder / NAME).mkdir()  # the disk refuses
        (number,) = _listed(after)
        assert refused(_taken_back(after, number), 503).code == "link_not_kept"
        assert refused(phone.get("/api/recordings/jump-1", headers=good), 401).code == "link_taken_back"
        assert told == ["event_links_not_kept"]


def test_a_list_that_cannot_be_read_ends_all_links(tmp_path: Path) -> None:
    before = kept_secret(tmp_path)
    for broken in (b"{", b'{"links": [{"recording": "a", "minute": -1, "made": 0}]}', b"\xff"):
        (tmp_path / NAME).write_bytes(broken)
        told: list[str] = []
        file = LinkFile(tmp_path, lambda said, told=told: told.append(said.code))  # type: ignore[misc]
        assert (file.broken, file.links, told) == (True, (), ["event_links_unreadable"])
        after = kept_secret(tmp_path, anew=file.broken)
        assert after.value != before.value
        assert kept_secret(tmp_path).value == after.value
        before = after


def test_what_is_deleted_is_shown_to_nobody(shared: Shared) -> None:
    with shared.opened("jump-1") as phone:
        shared.panel.service.delete_recording("jump-1")
        for part in SHOWN:
            refused(phone.get(f"/api/recordings/jump-1{part}"), 404)
        with shared.panel.client(headers=BEARER) as coach:
            assert refused(coach.get("/api/recordings/jump-1/link"), 409).code == "deleted_jump"
        shared.panel.service.restore_recording("jump-1")
        assert phone.get("/api/recordings/jump-1").status_code == 200


def test_phones_read_no_pictures_while_a_recording_runs(shared: Shared) -> None:
    service = shared.panel.service
    with shared.opened("jump-1") as phone, shared.panel.client(headers=BEARER) as coach:
        coach.post("/api/arm")
        started = coach.post("/api/recordings", json={}).json()["id"]
        assert service.state is State.RECORDING
        answer = phone.get("/api/recordings/jump-1/pulses/1.jpg")
        assert refused(answer, 503).code == "recording_runs"
        assert int(answer.headers["retry-after"]) > 0
        refused(phone.get("/api/recordings/jump-1/measurement/files/report.html"), 503)
        assert phone.get("/api/recordings/jump-1/measurement?jumps=false").status_code == 200
        assert coach.get("/api/recordings/jump-1/pulses/1.jpg").status_code == 200
        coach.post(f"/api/recordings/{started}/stop", json={})
        assert phone.get("/api/recordings/jump-1/pulses/1.jpg").status_code == 200


def test_the_cookie_is_for_one_jump_and_for_no_script(shared: Shared) -> None:
    _, key = _parts(shared.link("jump-1"))
    with shared.phone() as phone:
        answer = phone.post(
            "/api/login/link", json={"recording": "jump-1", "key": key}, headers={"X-Forwarded-Proto": "https"}
        )
        cookie = answer.headers["set-cookie"]
    for wanted in ("Path=/api/recordings/jump-1;", "HttpOnly", "SameSite=strict", "Secure", "Max-Age=36"):
        assert wanted in cookie + ";", wanted
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert answer.headers["cache-control"] == "no-store"


def test_ids_are_written_as_the_page_writes_them(shared: Shared) -> None:
    write_recording(shared.panel.service.catalogue.directory, ODD)
    with shared.opened("%C3%85se%20(2)%2050%25!%20jump's") as phone:
        assert phone.get("/api/recordings/%C3%85se%20(2)%2050%25!%20jump's").json()["id"] == ODD


def test_the_code_holds_the_address_that_phones_use(shared: Shared) -> None:
    with shared.panel.client(headers=BEARER) as coach:
        hosts = {"Host": "hillpc.local:8443", "X-Forwarded-Proto": "https"}
        found = coach.get("/api/recordings/jump-1/link", headers=hosts).json()
        assert found["link"].startswith("https://hillpc.local:8443/#/jump/jump-1/")
        # Who sits at this computer does not know what the proxy is called and where it listens.
        assert refused(coach.get("/api/recordings/jump-1/link"), 409).code == "no_phones"
        refused(coach.get("/api/recordings/none/link"), 404)
    assert read_code(found["code"]) == found["link"]


def test_on_loopback_there_is_no_code(service: MemoryService, loopback: Loopback) -> None:
    write_recording(service.catalogue.directory, "jump")
    for environment in ({}, {"SVEV_TOKEN": TOKEN}):
        access = Access.for_address(loopback.host, None, [PHONES], environment)
        with serving(service, access, links=Links(b"s", access.tokens, HOUR_S)) as panel, panel.client() as local:
            answer = local.get("/api/recordings/jump/link", headers=BEARER | {"Host": PHONES})
            assert refused(answer, 409).code == "no_phones"


def test_at_this_computer_the_code_holds_a_name_that_the_service_was_told() -> None:
    def address(host: str, names: list[str], *, https: bool = False) -> str | None:
        access = Access.for_address("0.0.0.0", None, names, {"SVEV_TOKEN": TOKEN})  # noqa: S104
        headers = [(b"host", host.encode())]
        scope = {"type": "http", "scheme": "https" if https else "http", "headers": headers, "path": "/",
                 "server": ("192.168.1.20", 8000), "client": ("192.168.1.30", 50000), "query_string": b""}  # fmt: skip
        return address_for_phones(Request(scope), access)

    assert address("192.168.1.20:8000", []) == "http://192.168.1.20:8000"
    assert address("[fe80::1]:8000", ["10.0.0.7", PHONES]) == "http://[fe80::1]:8000"
    assert address("localhost:8000", ["10.0.0.7", PHONES], https=True) == "https://hillpc.local:8000"
    assert address("127.0.0.1:8000", ["fe80::1"]) == "http://[fe80::1]:8000"
    assert address("127.0.0.1:8000", []) is None


def test_links_stand_in_no_log(shared: Shared, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        _, key = _parts(shared.link("jump-1"))
        with shared.opened("jump-1") as phone:
            phone.get("/api/recordings/jump-1")
            phone.post("/api/login/link", json={"recording": "jump-1", "key": [key]})
    ours = [record.getMessage() for record in caplog.records if not record.name.startswith(("httpx", "httpcore"))]
    told = [event.message for event in shared.panel.service.events(0)]
    assert not any(key in text for text in ours + told)


def test_the_secret_is_kept_for_its_user_alone(tmp_path: Path) -> None:
    first = kept_secret(tmp_path)
    file = tmp_path / SECRET_NAME
    assert first.problem is None
    assert kept_secret(tmp_path) == first
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    file.write_bytes(b"half")
    assert kept_secret(tmp_path).value != first.value
    file.unlink()
    file.symlink_to("/dev/zero")
    strange = kept_secret(tmp_path)
    assert strange.problem is not None
    assert len(strange.value) == 32
    assert "cannot be kept" in strange.problem.text
    file.unlink()
    file.write_bytes(b"x" * 32)
    file.chmod(0o666)
    assert kept_secret(tmp_path).problem is not None


def test_other_tokens_sign_otherwise() -> None:
    tokens = [
        Tokens({b"one-token-of-16-letters": Role.ADMINISTER}),
        Tokens({b"one-token-of-16-letters": Role.WATCH}),
        Tokens({b"one-token-of-16-letters": Role.WATCH, b"two-token-of-16-letters": Role.OPERATE}),
    ]
    keys = [Links(b"s" * 32, each, HOUR_S, Clock()).make("jump")[0] for each in tokens]
    assert len(set(keys)) == 3


def read_code(svg: str) -> str:
    """What a QR code says, read by a program that has not made it from its drawing."""
    side = int(svg.partition('viewBox="0 0 ')[2].split()[0])
    picture = np.full((side, side), 255, np.uint8)
    for move in svg.rpartition('d="')[2].partition('"')[0].split("M")[1:]:
        column, row = move.partition("h")[0].split()
        picture[int(row), int(column)] = 0
    found, *_ = cv2.QRCodeDetector().detectAndDecode(np.kron(picture, np.ones((8, 8), np.uint8)))
    return str(found)


def test_a_code_is_a_square_with_room_around_it() -> None:
    text = "https://hillpc.local:8000/#/jump/20260214-101530/AcJp5q0mXb1c2d3e4f5g6h7i8j9"
    assert read_code(qr_svg(text)) == text
