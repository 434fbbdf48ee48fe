"""Notifications for people who are elsewhere: sent to a real HTTP server, and never in the way of a recording."""

import json
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from rig.api.fields import Model
from rig.api.recordings import Recording
from rig.api.statement import Statement
from rig.api.status import Alarm, CameraState, CameraStatus, DiskStatus, State, Status
from rig.errors import BadInputError, UnknownRecordingError
from rig.events import Event
from rig.settings.file import load_rig
from rig.settings.webhook import WebhookSettings
from service.alarms.delivery import Target, deliver
from service.alarms.messenger import QUEUE_MAX, Messenger
from service.alarms.occasions import Notification, Occasions
from svev import cli
from svev.doctor.finding import Level
from svev.doctor.webhook import look_at_webhook
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

TOKEN = "shibboleth-of-the-hill"  # noqa: S105


class _Receiver(ThreadingHTTPServer):
    """Takes notifications, and behaves as it is told.

    Attributes:
        taken: body and headers of each request.
        answers: status of the next answers, the last one for good; "hang" and "drip": none that ends.
    """

    daemon_threads = True

    def __init__(self, host: str, port: int = 0) -> None:
        super().__init__((host, port), _Handler)
        self.taken: list[tuple[dict[str, Any], dict[str, str]]] = []
        self.answers: list[int | str] = [204]
        self.over = threading.Event()

    @property
    def events(self) -> list[str]:
        """What the notifications are about."""
        return [body["event"] for body, _ in self.taken]


class _Handler(BaseHTTPRequestHandler):
    server: _Receiver

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        answers = self.server.answers
        answer = answers.pop(0) if len(answers) > 1 else answers[0]
        if isinstance(answer, int) and answer < 300:
            self.server.taken.append((body, dict(self.headers)))
        if isinstance(answer, int):
            self.send_response(answer)
            if answer in {301, 307}:
                self.send_header("Location", "http://elsewhere.example/new?secret=1")
            self.send_header("Content-Length", "0")
            self.end_headers()
        while answer == "hang" and not self.server.over.wait(0.05):
            pass
        while answer == "drip" and not self.server.over.wait(0.05):
            try:
                self.wfile.write(b"H")
            except OSError:
                return

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def _receiver(host: str, port: int = 0) -> Iterator[_Receiver]:
    server = _Receiver(host, port)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield server
    finally:
        server.over.set()
        server.shutdown()
        server.server_close()
        thread.join(10)


def _url(server: _Receiver) -> str:
    host, port = server.socket.getsockname()
    return f"http://{host}:{port}/hook/key?x=1"


def _no_recording(recording: str) -> Recording:
    raise UnknownRecordingError(f"recording {recording} is unknown")


def _notification(text: str) -> tuple[Notification, str]:
    return Notification.model_validate(
        {"event": "fault", "time": "2026-11-20T10:00:00Z", "rig": "r", "state": "fault", "level": "error", "text": text}
    ), ""


@pytest.mark.parametrize(
    ("answer", "reason", "final"),
    [
        (500, "answers 500: look at its log", False),
        (429, "answers 429: look at its log", False),
        (401, "answers 401: look at the address and the token", True),
        (307, "redirects (307), which is not followed: give the address that it leads to", True),
        ("hang", "did not answer within 0.3 s: see whether it runs and can be reached", False),
        ("drip", "did not answer within 0.3 s: see whether it runs and can be reached", False),
    ],
)
def test_whatever_the_receiver_does_there_is_an_answer_in_time(
    loopback: Loopback, answer: int | str, reason: str, final: bool
) -> None:
    with _receiver(loopback.host) as server:
        server.answers = [answer]
        failure = deliver(Target(_url(server), TOKEN), b"{}", deadline_s=0.3)
    assert failure is not None
    assert (failure.said.text, failure.final) == (f"{loopback.host} {reason}", final)


def test_where_nobody_listens_is_said_without_the_secret_path(loopback: Loopback) -> None:
    failure = deliver(Target(f"http://{loopback.host}:{loopback.free_port()}/secret"), b"{}")
    assert failure is not None
    assert failure.said.text == (
        f"{loopback.host} cannot be reached (Connection refused): see whether it runs, and its name and port"
    )


def test_the_latest_wait_for_a_receiver_that_is_away_and_it_is_told_how_many_were_dropped(loopback: Loopback) -> None:
    said: list[Event] = []
    port = loopback.free_port()
    webhook = WebhookSettings(url=f"http://{loopback.host}:{port}/")
    with Messenger(webhook, said.append, _no_recording, first_pause_s=0.05) as messenger:
        messenger.offer([_notification("first")])
        wait_until(lambda: bool(said), "the failure is said")
        for number in range(QUEUE_MAX + 7):
            messenger.offer([_notification(f"number {number}")])
        with _receiver(loopback.host, port) as server:
            server.answers = [500, 500, 204]
            wait_until(lambda: len(server.taken) == QUEUE_MAX + 1, "all that waited arrive", PATIENCE_S)
            wait_until(lambda: len(said) == 2, "that they arrive again is said")
            bodies = [body for body, _ in server.taken]
    assert [body["text"] for body in bodies[:2]] == ["first", "number 7"]
    assert [body["number"] for body in bodies] == [1, *range(9, QUEUE_MAX + 9)]
    assert (bodies[0]["dropped"], bodies[1]["dropped"]) == (7, 0)
    assert "notifications do not arrive" in said[0].message
    assert said[1].message == "notifications arrive again; 7 were dropped"


def test_a_hanging_receiver_does_not_keep_the_service_from_ending(loopback: Loopback) -> None:
    with _receiver(loopback.host) as server:
        server.answers = ["hang"]
        began = threading.active_count()
        with Messenger(WebhookSettings(url=_url(server)), lambda _: None, _no_recording, deadline_s=0.5) as messenger:
            messenger.offer([_notification("first"), _notification("second")])
            wait_until(lambda: threading.active_count() > began, "it is being sent")
        wait_until(lambda: not any(each.name == "webhook" for each in threading.enumerate()), "its thread has ended")


def _rig(folder: Path, loopback: Loopback, url: str) -> Path:
    (folder / "token").write_text(TOKEN + "\n")
    path = write_rig(folder, "sim", loopback)
    table = f'[service.webhook]\nurl = "{url}"\ntoken_file = "token"\n'
    path.write_text(path.read_text().replace("[network]", f"{table}[network]"))
    return path


def test_a_service_tells_of_a_recording_and_of_a_camera_that_is_gone(tmp_path: Path, loopback: Loopback) -> None:
    with (
        _receiver(loopback.host) as server,
        serving(tmp_path, _rig(tmp_path, loopback, _url(server)), loopback) as service,
    ):
        service.arm()
        recording = service.post("/api/recordings", {"bib": "17", "athlete": "Ola"})["id"]
        os.kill(service.pids()["K2"], signal.SIGKILL)
        wait_until(lambda: "cameras" in server.events, "the loss of K2 is told", PATIENCE_S)
        service.post(f"/api/recordings/{recording}/stop")
        wait_until(lambda: "recording" in server.events, "the end of the recording is told", PATIENCE_S)
        gone = next(body for body, _ in server.taken if body["event"] == "cameras")
        assert (gone["level"], gone["text"].startswith("K2 is absent: grabber process ended")) == ("error", True)
        ended, headers = next(each for each in server.taken if each[0]["event"] == "recording")
        assert ended["recording"]["id"] == recording
        assert ended["text"].startswith(f"recording {recording} ended (17 Ola): ")
        assert headers["Authorization"] == f"Bearer {TOKEN}"
        server.answers = [307]
        service.post("/api/disarm")


def test_a_webhook_that_is_away_is_said_once_and_holds_up_no_recording(tmp_path: Path, loopback: Loopback) -> None:
    url = f"http://{loopback.host}:{loopback.free_port()}/secret-path"
    with serving(tmp_path, _rig(tmp_path, loopback, url), loopback) as service:
        service.arm()
        for _ in range(2):
            recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
            service.await_pulses(30)
            ended = service.post(f"/api/recordings/{recording}/stop", {"confirm": True})
            assert ended["counts"]["pulses"] >= 30
        wait_until(lambda: "webhook: notifications do not arrive" in service.log.read_text(), "it is said", PATIENCE_S)
    said = service.log.read_text()
    assert (said.count("webhook:"), "secret-path" in said) == (1, False)


def test_the_doctor_says_whether_the_webhook_takes_a_test(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    with _receiver(loopback.host) as server:
        rig = _rig(tmp_path, loopback, _url(server))
        assert cli.main(["doctor", "--rig", str(rig), "--send-test"]) == 0
        assert server.events == ["test"]
        (there,) = look_at_webhook(load_rig(rig))
        assert (there.level, server.events) == (Level.PASS, ["test"])
        server.answers = [401]
        assert cli.main(["doctor", "--rig", str(rig), "--send-test"]) == 3
    told = capsys.readouterr().out
    assert f"the webhook does not take the test: {loopback.host} answers 401: look at the address" in told
    (away,) = look_at_webhook(load_rig(rig))
    assert (away.level, "notifications wait" in away.remedy) == (Level.WARN, True)
    assert cli.main(["doctor", "--rig", str(write_rig(tmp_path, "sim", loopback)), "--send-test"]) == 2


@pytest.mark.parametrize(
    ("table", "wrong"),
    [
        ("", "needs its address"),
        ('url = "ftp://example.org"', "no address of a webhook"),
        ('url = "https://example.org:port/"', "no address of a webhook"),
        ('url = "https://me:secret@example.org/"', "put the secret into token_file"),
        ('url = "https://example.org/"\nevents = []', "service.webhook.events"),
    ],
)
def test_a_wrong_table_is_refused(tmp_path: Path, loopback: Loopback, table: str, wrong: str) -> None:
    path = write_rig(tmp_path, "sim", loopback)
    path.write_text(path.read_text() + f"[service.webhook]\n{table}\n")
    with pytest.raises(BadInputError, match=wrong):
        load_rig(path)


def _part(model: type[Model], **fields: Any) -> Any:
    """An object with these fields alone."""
    return model.model_construct(None, **fields)


def _status(state: State, cameras: dict[str, CameraState], jumps_left: int = 50) -> Status:
    """What matters of a status."""
    said = Statement(code="said", text="in words", advice="do something")
    found: Status = _part(
        Status, state=state, statement=said, rig="hill", last_recording=None,
        cameras=tuple(_part(CameraStatus, name=name, state=each, statement=said) for name, each in cameras.items()),
        disk=_part(DiskStatus, jumps_left=jumps_left, jump_s=10.0),
    )  # fmt: skip
    return found


def test_a_camera_that_comes_and_goes_is_told_once_a_minute_and_how_it_is_in_the_end() -> None:
    occasions, told = Occasions(("cameras", "fault", "disk")), []
    for second in range(200):
        loose = CameraState.ABSENT if second % 4 < 3 and second < 130 else CameraState.READY
        status = _status(State.ARMED, {"K1": CameraState.READY, "K2": loose}, jumps_left=25 - second // 10)
        told += [(second, each.event, each.over) for each, _ in occasions.look(status, 1000.0 + second)]
    cameras = [(second, over) for second, event, over in told if event == "cameras"]
    assert cameras == [(0, False), (63, True), (124, False), (184, True)]
    assert [second for second, event, _ in told if event == "disk"] == [50]


def test_a_fault_is_told_with_its_end_but_not_if_somebody_disarms() -> None:
    occasions = Occasions(("fault",))
    states = (State.ARMING, State.FAULT, State.ARMING, State.FAULT, State.ARMED, State.FAULT, State.IDLE, State.ARMED)
    told = [
        [each.over for each, _ in occasions.look(_status(state, {}), 100.0 * at)] for at, state in enumerate(states)
    ]
    assert told == [[], [False], [], [], [True], [False], [], []]
    assert not Occasions(("disk",)).look(_status(State.FAULT, {}), 0.0)


def test_an_alarm_is_told_when_it_begins_when_it_gets_worse_and_when_it_is_over_but_not_if_somebody_disarms() -> None:
    occasions, told = Occasions(("alarms",)), []
    steps: list[tuple[State, list[str]]] = [
        (State.ARMED, []), (State.ARMED, ["warning"]), (State.RECORDING, ["warning"]), (State.ARMED, ["error"]),
        (State.ARMED, []), (State.ARMED, ["error"]), (State.IDLE, []), (State.ARMED, []),
    ]  # fmt: skip
    for at, (state, levels) in enumerate(steps):
        said = [Statement(level=level, code="alarm_spread", text=f"in words: {level}") for level in levels]
        alarms = tuple(_part(Alarm, number=at, topic="spread", statement=each) for each in said)
        status = _status(state, {}).model_copy(update={"alarms": alarms})
        told.append([each.text for each, _ in occasions.look(status, 100.0 * at)])
    assert told == [
        [], ["in words: warning"], [], ["in words: error"], ["over: in words: warning", "over: in words: error"],
        ["in words: error"], [], [],
    ]  # fmt: skip
