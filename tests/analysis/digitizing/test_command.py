"""`svev digitize`: the page of one log, its marks on the disk, its end."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from bench.analysis.hill_logs import HillLog
from tests.support.commands import Command, run_svev, start_svev
from tests.support.waiting import wait_until


@contextmanager
def _served(*arguments: str) -> Iterator[tuple[Command, str]]:
    """The command, and the address of its page."""
    with start_svev("digitize", *arguments) as command:
        wait_until(lambda: "\n" in command.written()[0] or command.poll() is not None, "it says its address", 60)
        said = command.written()[0].strip()
        assert said.startswith("svev: measure at http://127.0.0.1:"), command.written()
        yield command, said.removeprefix("svev: measure at ")


def test_marks_are_there_after_the_command_was_killed(jump: HillLog) -> None:
    with _served(str(jump.path), "--survey", str(jump.survey)) as (command, page):
        url = httpx.URL(page)
        base = f"http://{url.host}:{url.port}/api/recordings/{url.params['recording']}/digitizing"
        with httpx.Client(timeout=30) as client:
            assert (
                client.get(f"http://{url.host}:{url.port}/").headers["location"] == f"{url.path}?{url.query.decode()}"
            )
            found = client.get(base).raise_for_status().json()
            assert [camera["name"] for camera in found["cameras"]] == ["K1", "K2", "K3"]
            assert found["status"]["K1"] == "o" * len(found["pulses"])
            assert client.get(f"{base}/frames/20/K2.png").content.startswith(b"\x89PNG")
            assert client.get(f"{base}/frames/9999/K2.png").status_code == 404
            action = {"do": "place", "pulse": 20, "camera": "K1", "thing": "P1", "xy": [100.5, 99.25]}
            assert client.post(f"{base}/sessions/Anna/actions", json=action).json()["undo"] == 1
            assert client.post(f"{base}/sessions/../actions", json=action).status_code == 404
        command.send_signal(signal.SIGKILL)
        command.wait(20)
    with _served(str(jump.path)) as (command, page):
        url = httpx.URL(page)
        base = f"http://{url.host}:{url.port}/api/recordings/{url.params['recording']}/digitizing"
        with httpx.Client(timeout=30) as client:
            view = client.get(f"{base}/sessions/Anna/pulses/20").json()
            assert view["marks"]["K1"]["P1"]["xy"] == [100.5, 99.25]
            other = {"origin": "http://elsewhere.example"}
            refused = client.post(f"{base}/sessions/Anna/actions", json={"do": "undo"}, headers=other)
            assert refused.status_code == 403
        command.send_signal(signal.SIGTERM)
        assert command.wait(20) == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("nowhere.mcap",), "nowhere.mcap"),
        (("LOG", "--survey", "nowhere.json"), "nowhere.json: no such file"),
        (("LOG", "--survey", "LOG", "--calibration", "LOG"), "give either the survey"),
    ],
)
def test_bad_input_is_refused_in_one_line(jump: HillLog, options: tuple[str, ...], said: str) -> None:
    done = run_svev("digitize", *(str(jump.path) if option == "LOG" else option for option in options))
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not Path(jump.path.with_suffix(".digitized")).exists()
