"""Off-loading is cut off at random, again and again: nothing is lost, and nothing is copied twice."""

import errno
import hashlib
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import numpy as np
import pytest

from tests.capture.rigs import write_rig
from tests.recorder.logs import ALL_OK, write_log
from tests.recorder.split import split_log
from tests.service.serving import Serving, serving
from tests.support.cut_network import cut_network
from tests.support.faulty_disk import FaultyDisk
from tests.support.loopback import Loopback
from tests.support.object_store import KEYS, keep_all, object_store, put, take, versions
from tests.support.other_disk import other_disk
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.long, pytest.mark.alone, pytest.mark.timeout(1500)]

_CUTS: Final = 50
_PATIENCE_S: Final = 400.0
#: A cut comes at any moment within so long after the first copy is at work.
_WITHIN_S: Final = 0.6
_LARGE: Final = 6
#: Cuts of one service; the last one kills it.
_AT_A_TIME: Final = 4


def _recordings(folder: Path) -> dict[str, bytes]:
    """Logs of a day: one that is split, small ones, and some that take a while to copy; all by name."""
    folder.mkdir()
    write_log(folder / "first.mcap", (ALL_OK,) * 9)
    split_log(folder / "first.mcap", folder / "long.mcap", (4, 3))
    for number in range(4):
        write_log(folder / f"small-{number}.mcap", (ALL_OK,) * (2 + number))
        (folder / f"small-{number}.measured").mkdir()
        (folder / f"small-{number}.measured" / "report.html").write_text(f"report {number}")
    head = (folder / "first.mcap").read_bytes()
    for number in range(_LARGE):  # a log that was never closed, with what no reader understands behind it
        (folder / f"large-{number}.mcap").write_bytes(head + np.random.default_rng(number).bytes(24_000_000))
    return {path.name: path.read_bytes() for path in folder.glob("*.mcap")}


def _larger_than_a_piece(folder: Path) -> dict[str, bytes]:
    """A log that goes into an object store in two pieces, by name."""
    path = folder / "largest.mcap"
    path.write_bytes((folder / "first.mcap").read_bytes() + np.random.default_rng(_LARGE).bytes(80_000_000))
    return {path.name: path.read_bytes()}


def _uploader(service: Serving) -> int | None:
    """The program that copies, if it runs."""
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if b"service.offloading.copying" in (entry / "cmdline").read_bytes():
                ancestor = int(entry.name)
                while ancestor > 1:
                    ancestor = int((Path("/proc") / str(ancestor) / "stat").read_text().rpartition(")")[2].split()[1])
                    if ancestor == service.pid:
                        return int(entry.name)
    return None


def _kill_uploader(service: Serving) -> None:
    if (pid := _uploader(service)) is not None:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@contextmanager
def _cut_service(folder: Path, rig: Path, loopback: Loopback, environment: dict[str, str]) -> Iterator[Serving]:
    """A service that ends by SIGKILL."""
    with serving(folder, rig, loopback, environment=environment, ends_with=-signal.SIGKILL) as service:
        yield service
        service.signal(signal.SIGKILL)


def _rig(folder: Path, loopback: Loopback, offload: str) -> Path:
    rig = write_rig(folder, "sim", loopback)
    rig.write_text(f"{rig.read_text()}\n[offload]\n{offload}\n")
    return rig


def _record_again(folder: Path) -> None:
    """The recordings in the trash lie in the folder as if they had just been recorded, and nothing of them is copied.

    One that was fetched from the trash would not be released for a day.
    """
    for path in (folder / ".trash").glob("*"):
        path.rename(folder / path.name)
        os.utime(folder / path.name)
    (folder / ".svev-offload.json").unlink()


def _whole(folder: Path, logs: dict[str, bytes]) -> None:
    """Each log is once in the folder or in its trash, as it was."""
    found = [path for place in (folder, folder / ".trash") for path in place.glob("*.mcap")]
    assert sorted(path.name for path in found) == sorted(logs)
    assert [path.name for path in found if path.read_bytes() != logs[path.name]] == []


def _await_release(service: Serving, logs: dict[str, bytes]) -> None:
    trash = service.data / ".trash"
    try:
        wait_until(lambda: {path.name for path in trash.glob("*.mcap")} == {*logs}, "all are released", _PATIENCE_S)
    except AssertionError as error:
        error.add_note(f"released: {[path.name for path in trash.glob('*.mcap')]}\n{service.log.read_text()}")
        raise


def _confirmed(there: Path) -> dict[str, tuple[int, int]]:
    """The copies that count, and what tells when they were written."""
    stats = {path.stem: (there / path.stem).stat() for path in there.glob("*.mcap.sha256")}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


def _check_copies(there: Path, logs: dict[str, bytes]) -> None:
    """The copies are all logs, each once and as it was, with its checksum; nothing half made is beside them."""
    results = {f"small-{number}.measured" for number in range(4)}
    assert {path.name for path in there.iterdir()} == {*logs, *(f"{name}.sha256" for name in logs), *results}
    for name, content in logs.items():
        assert (there / name).read_bytes() == content
        assert (there / f"{name}.sha256").read_text() == f"{hashlib.sha256(content).hexdigest()}  {name}\n"
    checked = ["/usr/bin/sha256sum", "--check", "--quiet", *(f"{name}.sha256" for name in logs)]
    subprocess.run(checked, cwd=there, check=True)
    assert {(there / name / "report.html").read_text() for name in results} == {f"report {n}" for n in range(4)}


def test_fifty_cuts_lose_nothing_and_copy_nothing_twice(tmp_path: Path, loopback: Loopback, disk: FaultyDisk) -> None:
    """The service or its copying program is killed, the other disk is gone or full, while recordings are released."""
    logs, draw = _recordings(tmp_path / "data"), random.Random(50)
    with other_disk() as other:
        there, away = other / "jumps", other / "away"
        there.mkdir()
        rig = _rig(tmp_path, loopback, f'to = "{there}"\nkeep_free_GB = 1e6')
        begun, known = 0, dict[str, tuple[int, int]]()

        def gone(_: Serving) -> None:
            there.rename(away)

        def full(_: Serving) -> None:
            disk.fail(errno.ENOSPC, only=there)

        cuts: tuple[Callable[[Serving], None], ...] = (lambda _: None, _kill_uploader, gone, full)
        for cut in range(_CUTS):
            # Once all are copied (the result of a log behind it): once more from the beginning, with other files.
            if len(known) == len(logs) and not any(there.glob(".*.part")):
                _whole(tmp_path / "data", logs)
                _check_copies(there, logs)
                for path in there.glob("large-*"):
                    path.unlink()
                    known.pop(path.name, None)
                _record_again(tmp_path / "data")
            with _cut_service(tmp_path, rig, loopback, dict(disk.environment)) as service:
                with suppress(AssertionError):  # there may be nothing left to do
                    wait_until(lambda: _uploader(service) is not None, "it copies", 5)
                    begun += 1
                time.sleep(draw.uniform(0, _WITHIN_S))
                cuts[cut % len(cuts)](service)
                if cut % len(cuts):
                    time.sleep(draw.uniform(0, _WITHIN_S))
            disk.heal()
            if away.exists():
                away.rename(there)
            _whole(tmp_path / "data", logs)
            now = _confirmed(there)
            assert {name: now.get(name) for name in known} == known, "what is copied is not copied again"
            known = now
        assert begun > _CUTS // 2, "most cuts hit a copy"
        with serving(tmp_path, rig, loopback) as service:
            _await_release(service, logs)
        _whole(tmp_path / "data", logs)
        _check_copies(there, logs)
        assert {name: _confirmed(there)[name] for name in known} == known


def test_fifty_cuts_of_a_store_lose_nothing_and_copy_nothing_twice(tmp_path: Path, loopback: Loopback) -> None:
    """A real S3 server that keeps every version; the network is cut, or the service or its copying program killed."""
    data, draw = tmp_path / "data", random.Random(51)
    logs = _recordings(data)
    logs |= _larger_than_a_piece(data)
    with object_store(loopback) as address, cut_network(loopback.host, urlsplit(address).port or 0) as way:
        put(address, "hill")
        keep_all(address, "hill")
        cuts, known, round_number = 0, dict[str, tuple[str, ...]](), 0

        def rig() -> Path:
            return _rig(
                tmp_path, loopback, f'store = "s3://hill/{round_number}"\nkeep_free_GB = 1e6\n'
                f'store_options = {{ endpoint_url = "http://{loopback.host}:{way.port}" }}'
            )  # fmt: skip

        def check() -> None:
            """Each log is here; what is copied is not copied again; what is released lies in the store."""
            nonlocal known
            _whole(data, logs)
            now = versions(address, "hill")
            confirmed = {name: each for name, each in now.items() if name.endswith(".mcap") and f"{name}.sha256" in now}
            assert {name: confirmed.get(name) for name in known} == known
            released = {f"{round_number}/{path.name}" for path in (data / ".trash").glob("*.mcap")}
            assert released <= {*confirmed}
            known = confirmed

        def begin_again() -> None:
            """All are released: once more, to another place in the store."""
            nonlocal round_number
            take(address, f"hill/{round_number}", str(tmp_path / f"taken-{round_number}"))
            _check_copies(tmp_path / f"taken-{round_number}", logs)
            _record_again(data)
            round_number += 1

        while cuts < _CUTS:
            with _cut_service(tmp_path, rig(), loopback, KEYS) as service:
                for cut in draw.choices((_kill_uploader, lambda _: way.cut()), k=_AT_A_TIME - 1):
                    with suppress(AssertionError):  # there may be nothing left to do
                        wait_until(lambda: _uploader(service) is not None, "it copies", 5)
                        cuts += 1
                    time.sleep(draw.uniform(0, 3 * _WITHIN_S))
                    cut(service)
                    time.sleep(draw.uniform(0, _WITHIN_S))
                    way.heal()
                cuts += _uploader(service) is not None
            check()
            if len([*(data / ".trash").glob("*.mcap")]) == len(logs):
                begin_again()
        with serving(tmp_path, rig(), loopback, environment=KEYS) as service:
            _await_release(service, logs)
        check()
        begin_again()
