"""Whatever stands in a name, a terminal shows it and does not obey it; JSON stays JSON."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.events import Event, Level
from rig.phrase import plain
from svev.console import visible
from svev.serving.systemd import log_line
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback

#: Clears the screen, sets the title of the window, turns the direction of writing, begins a new line, rings.
EVIL = "\x1b[2J\x1b]0;owned\x07\x9b31m\u202eabc\u2028\r\nnext\x7f"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Bjørn Daehlie 冬 😀 :smile: [bold]x[/bold]", "Bjørn Daehlie 冬 😀 :smile: [bold]x[/bold]"),
        ("a\x1b[31mb", "a\\x1b[31mb"),
        ("a\nb\tc\r", "a\\nb\\tc\\r"),
        ("\x9b\x7f\x00", "\\x9b\\x7f\\x00"),
        ("\u202e\u2066\u200b\u2028\ufeff", "\\u202e\\u2066\\u200b\\u2028\\ufeff"),
        ("caf\udce9", "caf\\xe9"),
    ],
)
def test_what_a_terminal_would_obey_is_written_out(text: str, shown: str) -> None:
    assert visible(text) == shown


def _svev(*arguments: str | bytes) -> "subprocess.CompletedProcess[str]":
    return run_svev(*map(os.fsdecode, arguments))


def _is_harmless(*texts: str) -> None:
    for text in texts:
        for line in text.split("\n"):
            assert line.isprintable(), repr(line)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log with such names, in a file of such a name."""
    path = tmp_path / f"{EVIL[:4]}.mcap"
    description = LogDescription({"athlete": EVIL, "session": EVIL}, {"name": EVIL, "cameras": EVIL}, b"")
    with LogWriter(path, description, TripletBuffers((16, 16), 2)) as writer:
        writer.write_event(Event.now(Level.ERROR, f"K1{EVIL}", plain(f"connected: {EVIL}")))
    return path


@pytest.mark.parametrize("command", ["info", "verify"])
def test_names_in_a_log_and_of_a_file(command: str, log: Path) -> None:
    done = _svev(command, str(log))
    assert "\\x1b[2J" in done.stdout
    assert "owned" in done.stdout
    _is_harmless(done.stdout, done.stderr)
    as_json = _svev(command, str(log), "--json")
    _is_harmless(as_json.stdout)
    assert str(log) in json.loads(as_json.stdout).values()


def test_names_in_errors_and_wrong_usage(tmp_path: Path) -> None:
    for done in (
        _svev("info", f"{tmp_path}/{EVIL}"),
        _svev("info", os.fsencode(tmp_path) + b"/\xff\x1b[31m"),
        _svev("record", "--rig", f"{tmp_path}/{EVIL}", "--seconds", "1", "--out", EVIL),
        _svev(EVIL),
        _svev("info", f"--{EVIL}"),
        _svev("ctl", "--url", f"http://127.0.0.1:1/{EVIL}", "status"),
        _svev("bench", EVIL),
    ):
        assert done.returncode in {2, 6}, done.stderr
        assert "\\x1b" in done.stderr
        assert "Traceback" not in done.stderr
        _is_harmless(done.stdout, done.stderr)


def test_events_of_a_camera_on_the_terminal_and_in_the_journal() -> None:
    event = Event.now(Level.INFO, "K1", plain(f"connected: {EVIL}"))
    _is_harmless(log_line(event, journal=True), log_line(event, journal=False))


def test_what_the_service_tells_of(tmp_path: Path, loopback: Loopback) -> None:
    unseen = "\x9b31m\u202eabc"  # the API refuses the others
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        service.post("/api/recordings", {"athlete": unseen, "duration_s": 0})
        service.await_state("armed")
        listed = _svev("ctl", "--url", service.url, "list")
        assert "\\x9b31m\\u202eabc" in listed.stdout
        _is_harmless(listed.stdout, listed.stderr)
        as_json = json.loads(_svev("ctl", "--url", service.url, "list", "--json").stdout)
        assert as_json["recordings"][0]["session"]["athlete"] == unseen
