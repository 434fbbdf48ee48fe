"""`svev digitize`: the page of one log, its marks on the disk, its end."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import numpy as np
import pytest

from bench.analysis.hill_logs import HillLog
from tests.support.commands import Command, run_svev, start_svev
from tests.support.waiting import wait_until

_NO_TLS = False  # the certificates of this computer need not be loaded, which takes 25 ms


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
        with httpx.Client(timeout=30, verify=_NO_TLS) as client:
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
        with httpx.Client(timeout=30, verify=_NO_TLS) as client:
            view = client.get(f"{base}/sessions/Anna/pulses/20").json()
            assert view["marks"]["K1"]["P1"]["xy"] == [100.5, 99.25]
            other = {"origin": "http://elsewhere.example"}
            refused = client.post(f"{base}/sessions/Anna/actions", json={"do": "undo"}, headers=other)
            assert refused.status_code == 403
        command.send_signal(signal.SIGTERM)
        assert command.wait(20) == 0
    with _served(str(jump.path)) as (command, _):
        command.send_signal(signal.SIGHUP)
        assert command.wait(20) == 0, "a closed terminal ends it in order"


@pytest.mark.long
@pytest.mark.parametrize("part", range(8))
def test_a_page_that_is_killed_again_and_again_loses_at_most_the_action_under_way(jump: HillLog, part: int) -> None:
    random = np.random.default_rng(part)
    answered = 0
    for _ in range(25):
        with _served(str(jump.path)) as (command, page), httpx.Client(timeout=30, verify=_NO_TLS) as client:
            url = httpx.URL(page)
            base = f"http://{url.host}:{url.port}/api/recordings/{url.params['recording']}/digitizing/sessions/Anna"
            kept = client.get(base).raise_for_status().json()["revision"]
            assert kept in {answered, answered + 1}
            answered = kept
            # an action takes a few milliseconds, so it comes at any moment of one
            killer = threading.Timer(float(random.uniform(0.01, 0.07)), command.send_signal, (signal.SIGKILL,))
            killer.start()
            with suppress(httpx.TransportError):
                while True:
                    where = {"pulse": answered % 38 + 1, "camera": "K1", "thing": "P1", "xy": [answered, part]}
                    client.post(f"{base}/actions", json={"do": "place", **where}).raise_for_status()
                    answered += 1
            killer.join()
            command.wait(20)
    with _served(str(jump.path)) as (_, page), httpx.Client(timeout=30, verify=_NO_TLS) as client:
        url = httpx.URL(page)
        base = f"http://{url.host}:{url.port}/api/recordings/{url.params['recording']}/digitizing/sessions/Anna"
        revision = client.get(base).raise_for_status().json()["revision"]
        assert revision in {answered, answered + 1}
        last = revision - 1
        mark = client.get(f"{base}/pulses/{last % 38 + 1}").json()["marks"]["K1"]["P1"]
        assert mark["xy"] == [last, part]
    assert answered > 25


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
