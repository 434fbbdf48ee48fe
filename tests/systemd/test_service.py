"""The service under the real systemd: start, sandbox, watchdog, stop. Skipped where systemd cannot be booted."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.waiting import wait_until
from tests.systemd.booted import CHECKOUT, Booted, booted
from tests.systemd.prefixes import units_into

pytestmark = pytest.mark.long


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """What `make install PREFIX=/opt/prefix` makes, but the program is that of the checkout; the rig is simulated."""
    prefix = tmp_path / "prefix"
    units_into(prefix, '#!/bin/sh\nexport PYTHONPATH=/opt/svev\nexec /opt/svev/.venv/bin/python -m svev "$@"\n')
    for path in prefix.rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes().replace(bytes(prefix), b"/opt/prefix"))
    rig = (CHECKOUT / "config" / "rigs" / "sim.toml").read_text()
    (prefix / "etc/svev/rig.toml").write_text(rig.replace('"../', '"/opt/svev/config/'))
    return prefix


@pytest.fixture
def systemd(prefix: Path) -> Iterator[Booted]:
    """Runs, and the service is ready."""
    with booted(prefix) as system:
        wait_until(lambda: system.show("ActiveState") == "active", "the service is ready")
        yield system


def _ctl(system: Booted, *arguments: str) -> dict[str, object]:
    answer = json.loads(system.run("/opt/prefix/bin/svev", "ctl", *arguments, "--json"))
    assert isinstance(answer, dict)
    return answer


def _await_state(system: Booted, state: str) -> None:
    wait_until(lambda: _ctl(system, "status")["state"] == state, f"the state is {state}")


def test_stopping_the_unit_finishes_the_recording(systemd: Booted) -> None:
    assert "svev" in systemd.run("ps", "-o", "user=", "-p", systemd.show("MainPID"))
    _ctl(systemd, "arm")
    _await_state(systemd, "armed")
    recording = _ctl(systemd, "start", "--athlete", "Ola", "--bib", "17")
    _await_state(systemd, "recording")
    assert "recording" in systemd.show("StatusText").lower()

    systemd.systemctl("stop", "svev.service")

    assert systemd.show("Result") == "success"
    assert systemd.show("ExecMainStatus") == "0"
    log = f"/var/lib/svev/recordings/{recording['id']}.mcap"
    systemd.run("/opt/prefix/bin/svev", "verify", log)


def test_a_service_that_hangs_is_started_again(systemd: Booted) -> None:
    first = systemd.show("MainPID")

    systemd.run("kill", "-STOP", first)

    wait_until(lambda: systemd.show("NRestarts") == "1", "the watchdog has fired", 60)
    wait_until(lambda: systemd.show("ActiveState") == "active", "the service is ready again")
    assert systemd.show("MainPID") != first
    assert _ctl(systemd, "status")["state"] == "idle"


def test_a_wrong_rig_file_is_not_tried_again(prefix: Path) -> None:
    (prefix / "etc/svev/rig.toml").write_text("name = 3\n")
    with booted(prefix) as system:
        wait_until(lambda: system.show("ActiveState") == "failed", "the service has given up")
        assert system.show("ExecMainStatus") == "2"
        assert system.show("NRestarts") == "0"
        assert "rig.toml" in system.log()


def _second_disk(system: Booted) -> tuple[str, str]:
    """What the service's doctor says of the second disk, level and words."""
    ask = "import httpx; print(httpx.get('http://127.0.0.1:8000/api/doctor', timeout=60).text)"
    report = json.loads(system.run("/opt/svev/.venv/bin/python", "-c", ask))
    (finding,) = (each for each in report["findings"] if "fallback_directory" in each["what"])
    return finding["level"], finding["what"]


def _keep_exposure(system: Booted, exposure_us: int) -> tuple[int, str]:
    """Ask the service to keep an exposure of K1 in the rig file; status and body of its answer."""
    ask = (
        "import sys, httpx; answer = httpx.patch('http://127.0.0.1:8000/api/cameras/K1', timeout=60, "
        "json={'exposure_us': int(sys.argv[1]), 'save': True}); print(answer.status_code, answer.text)"
    )
    status, text = system.run("/opt/svev/.venv/bin/python", "-c", ask, str(exposure_us)).split(" ", 1)
    return int(status), text


def test_the_service_renews_its_rig_file_and_nothing_that_says_who_may_reach_it(systemd: Booted) -> None:
    folder = "/opt/prefix/etc/svev"
    rig = f"{folder}/rig.toml"
    first = systemd.run("cat", rig)
    assert _keep_exposure(systemd, 1234)[0] == 200
    kept = systemd.run("cat", rig)
    assert kept.count("exposure_us = 1234") == 1
    assert [line for line in kept.splitlines() if "#" in line] == [line for line in first.splitlines() if "#" in line]
    assert systemd.run("stat", "--format=%U:%G %a", rig) == "svev:svev 644\n"

    inside = ("nsenter", f"--target={systemd.show('MainPID')}", "--mount", "setpriv", "--reuid=svev", "--regid=svev")
    others = (
        "cd $0; for way in 'mv -fT rig.toml options' 'rm -f options' 'ln -sfnT rig.toml options'; do $way || true; done"
    )
    systemd.run(*inside, "--clear-groups", "sh", "-euc", others, folder)
    assert systemd.run("stat", "--format=%U:%G %F", f"{folder}/options") == "root:svev regular file\n"

    systemd.run("chown", "root:svev", rig)  # the owner keeps the file from the page
    status, said = _keep_exposure(systemd, 1500)
    assert (status, "cannot be written (Permission denied); write exposure_us = 1500" in said) == (507, True)
    assert systemd.run("cat", rig) == kept


def test_a_second_disk_can_be_written_when_the_unit_is_told(prefix: Path) -> None:
    rig = prefix / "etc/svev/rig.toml"
    fallback = '[recorder]\nfallback_directory = "/opt/second"\n[service]\narm_at_start = true\n'
    rig.write_text(f"{rig.read_text()}\n{fallback}")
    with booted(prefix) as system:
        wait_until(lambda: system.show("ActiveState") == "active", "the service is ready")
        _await_state(system, "armed")
        system.run("install", "-d", "-o", "svev", "/opt/second")
        level, what = _second_disk(system)
        assert (level, "Read-only file system" in what) == ("FAIL", True)

        drop_in = "printf '[Service]\\nReadWritePaths=/opt/second\\n' >/run/systemd/system/svev.service.d/disk.conf"
        system.run("sh", "-c", drop_in)
        system.systemctl("daemon-reload")
        system.systemctl("restart", "svev.service")

        _await_state(system, "armed")
        # Both are in memory here, which is one disk.
        level, what = _second_disk(system)
        assert (level, "on the same disk" in what) == ("WARN", True)
