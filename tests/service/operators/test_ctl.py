"""`svev ctl` against a real service."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import verify
from recorder.reading.info import info
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback

TOKEN = "a-token-for-the-tests-only"  # noqa: S105


def _ctl(url: str, *arguments: str, token: str = "") -> "subprocess.CompletedProcess[str]":
    environment = {"SVEV_URL": url, "SVEV_TOKEN": token}
    return run_svev("ctl", *arguments, timeout_s=120, environment=environment)


def _json(done: "subprocess.CompletedProcess[str]") -> Any:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.long
def test_a_training_from_the_command_line(tmp_path: Path, loopback: Loopback) -> None:
    (tmp_path / "token").write_text(TOKEN + "\n")
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback, "--token-file", str(tmp_path / "token"), token=TOKEN) as service:
        url = service.url
        assert _json(_ctl(url, "status", "--json", token=TOKEN))["state"] == "idle"
        refused = _ctl(url, "start", token=TOKEN)
        assert (refused.returncode, refused.stderr) == (
            1,
            "svev: the rig is not armed: arm it, then start recording\n",
        )
        armed = _ctl(url, "arm", token=TOKEN)
        assert armed.returncode == 0, armed.stderr
        assert armed.stdout.startswith("armed      armed")
        begun = _json(_ctl(url, "start", "--athlete", "Ola", "--bib", "17", "--json", token=TOKEN))
        assert begun["state"] == "recording"
        service.await_pulses(20)
        ended = _json(_ctl(url, "stop", "--json", token=TOKEN))
        assert (ended["id"], ended["state"], ended["session"]["bib"]) == (begun["id"], "finished", "17")
        assert _json(_ctl(url, "session", begun["id"], "--bib", "18", "--json", token=TOKEN))["session"]["bib"] == "18"
        (tmp_path / "list.csv").write_bytes("bib;navn;klubb;klasse\n17;Åse;Lyn;J18\n19;Eva;;K\n".encode("latin-1"))
        loaded = _ctl(url, "startlist", "load", str(tmp_path / "list.csv"), token=TOKEN).stdout
        assert loaded.splitlines()[1:] == ["next       17  Åse, Lyn, J18", "waiting    19  Eva, K"]
        assert _ctl(url, "skip", token=TOKEN).stdout.splitlines()[1].startswith("skipped ")
        assert _ctl(url, "next", "--gate", "11", token=TOKEN).stdout == "athlete Eva  bib 19  gate 11  klasse K\n"
        saved = _json(_ctl(url, "save", "--seconds", "1", "--json", token=TOKEN))
        assert 0 < saved["counts"]["pulses"] <= 33
        assert (saved["session"]["athlete"], saved["session"]["gate"]) == ("Eva", "11")
        assert (saved["more"], begun["more"]) == ({"klasse": "K", "round": "1"}, {})
        listed = _ctl(url, "list", token=TOKEN).stdout
        assert [line.split()[0] for line in listed.splitlines()] == [saved["id"], begun["id"]]
        assert "[18 Ola]" in listed
        assert "[19 Eva]" in listed
        assert _ctl(url, "list", "--search", "ola 18", token=TOKEN).stdout.split()[0] == begun["id"]
        assert _json(_ctl(url, "delete", begun["id"], "--json", token=TOKEN))["deleted"]
        assert len(_json(_ctl(url, "list", "--json", token=TOKEN))["recordings"]) == 1
        assert not _json(_ctl(url, "restore", begun["id"], "--json", token=TOKEN))["deleted"]
        folder = tmp_path / "jumps" / "today"  # is made
        fetched = _json(_ctl(url, "download", begun["id"], saved["id"], "-o", str(folder), "--json", token=TOKEN))
        files = [folder / f"18_Ola_{begun['id']}.mcap", folder / f"19_Eva_{saved['id']}.mcap"]
        assert fetched == {"files": [str(file) for file in files]}
        assert info(files[0]).session["bib"] == "18"
        assert not verify(files[0]).damaged
        again = _ctl(url, "download", begun["id"], "-o", str(folder), token=TOKEN)
        assert (again.returncode, "exists already" in again.stderr) == (2, True)
        assert _ctl(url, "trash", "--remove", saved["id"], token=TOKEN).returncode == 1
        _ctl(url, "delete", saved["id"], token=TOKEN)
        assert _ctl(url, "trash", token=TOKEN).stdout.startswith("1 recordings in the trash")
        assert _json(_ctl(url, "trash", "--empty", "--json", token=TOKEN))["recordings"] == 1
        assert _ctl(url, "stop", token=TOKEN).returncode == 1
        assert _ctl(url, "delete", "nonsense", token=TOKEN).returncode == 2
        assert _ctl(url, "start", "--notes", "x" * 5000, token=TOKEN).returncode == 2
        assert _ctl(url, "disarm", token=TOKEN).stdout.startswith("idle ")
        wrong = _ctl(url, "status", token=TOKEN[::-1])
        assert (wrong.returncode, "SVEV_TOKEN" in wrong.stderr) == (2, True)


def test_nobody_there_is_said_in_one_line(loopback: Loopback) -> None:
    done = _ctl(f"http://{loopback.host}:{loopback.free_port()}", "status")
    assert done.returncode == 6
    assert "start it with svev serve" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert _ctl("ftp://somewhere", "status").returncode == 2


def test_what_the_service_tells_is_shown_once_or_followed(tmp_path: Path, loopback: Loopback) -> None:
    """With the address behind the command, and names that a terminal would obey written out."""
    rig = write_rig(tmp_path, "sim", loopback)
    evil = tmp_path / "\x1b[31mred"
    with serving(tmp_path, rig, loopback, data=evil) as service:
        service.arm()
        at = ("--url", service.url)
        shown = _ctl("http://nowhere.invalid", "log", "--once", *at)
        assert shown.returncode == 0, shown.stderr
        assert re.search(r"^\d\d:\d\d:\d\d info    service: arming -> armed$", shown.stdout, re.MULTILINE)
        assert "\x1b" not in shown.stdout
        command = [sys.executable, "-m", "svev", "ctl", "log", f"--url={service.url}", "--json"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as following:
            assert following.stdout is not None
            before = [json.loads(following.stdout.readline())["message"] for _ in range(2)]
            recording = service.post("/api/recordings")["id"]
            service.post(f"/api/recordings/{recording}/stop", {"confirm": True})
            after = []
            while f"recording {recording} started" not in after:
                after.append(json.loads(following.stdout.readline())["message"])
            service.signal(signal.SIGTERM)
            assert service.exit_code() == 0
            assert following.wait(60) == 6
            assert following.stderr is not None
            assert "start it with svev serve" in following.stderr.read()
        assert before


def test_the_service_examines_and_errors_are_json_too(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback) as service:
        examined = _ctl(service.url, "doctor", "--json")
        found = json.loads(examined.stdout)
        assert examined.returncode == (3 if found["worst"] == "FAIL" else 0), examined.stderr
        shown = _ctl(service.url, "doctor")
        assert shown.returncode == examined.returncode
        assert " PASS, " in shown.stdout.splitlines()[-1]
        refused = _ctl(service.url, "start", "--json")
        assert json.loads(refused.stdout) == {
            "error": "the rig is not armed: arm it, then start recording", "exit_code": 1,
        }  # fmt: skip
        assert refused.returncode == 1
    gone = _ctl(service.url, "status", "--json")
    assert (gone.returncode, json.loads(gone.stdout)["exit_code"]) == (6, 6)
    wrong = _ctl(service.url, "stop", "--jsno", "--json")
    assert (wrong.returncode, "--jsno" in json.loads(wrong.stdout)["error"]) == (2, True)


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("svev ctl dow", {"download"}),
        ("svev rec", {"record", "recover"}),
        ("svev ctl save --b", {"--bib"}),
        ("svev ctl startlist ", {"load", "show", "undo"}),
    ],
)
def test_bash_completes_commands_and_options(tmp_path: Path, line: str, offered: set[str]) -> None:
    """In a real bash, by the script that svev prints."""
    (tmp_path / "svev").write_text(f'#!/bin/sh\nexec {sys.executable} -m svev "$@"\n')
    (tmp_path / "svev").chmod(0o755)
    script = """
        eval "$(svev completion bash)"
        read -ra COMP_WORDS <<< "$1"
        [[ "$1" == *" " ]] && COMP_WORDS+=("")
        COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 ))
        _svev_completion svev
        printf '%s\\n' "${COMPREPLY[@]}"
    """
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["/bin/bash", "-c", script, "bash", line],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=environment,
    )
    assert (set(done.stdout.split()), done.stderr) == (offered, "")
