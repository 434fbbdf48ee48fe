"""An upgrade beside a service that records: nobody notices until it is restarted.

Needs a bundle and a prefix in which it is installed, so `make wheel` runs it: SVEV_BUNDLE and SVEV_PREFIX name them.
"""

import os
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import cycle
from pathlib import Path

import httpx
import pytest

from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig

pytestmark = pytest.mark.long

_EVERY_S = 0.05
_INSTALL_S = 400.0


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """A bundle of this test's own."""
    if "SVEV_BUNDLE" not in os.environ:
        pytest.skip("needs a bundle and its installation: make wheel")
    return shutil.copytree(os.environ["SVEV_BUNDLE"], tmp_path / "bundle", symlinks=True, copy_function=os.link)


@pytest.fixture
def prefix() -> Path:
    return Path(os.environ["SVEV_PREFIX"])


def _install(bundle: Path, prefix: Path) -> "subprocess.CompletedProcess[str]":
    command = ["nice", str(bundle / "install"), str(prefix)]
    return subprocess.run(command, capture_output=True, text=True, timeout=_INSTALL_S, check=False)


def _current(prefix: Path) -> str:
    return (prefix / "lib/svev/current").readlink().name


def _versions_running(service: Serving) -> set[str]:
    """Versions whose programs the service and its processes run."""
    pids = [service.pid, *service.pids().values()]
    interpreters = [Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")[0].decode() for pid in pids]
    return {Path(interpreter).parents[1].name for interpreter in interpreters}


def _page_files(service: Serving, page: Path) -> list[str]:
    """Where the files of this folder are served: documents at the root, all others below their version."""
    place = re.search(r'src="\.(/page/[0-9a-f]+)/main\.js"', service.text("/"))
    assert place is not None
    names = [path.relative_to(page).as_posix() for path in page.rglob("*.*") if path.is_file()]
    return ["/", *(f"/{name}" if name.endswith(".html") else f"{place[1]}/{name}" for name in names)]


@contextmanager
def _asking(service: Serving, paths: list[str]) -> Iterator[dict[str, int]]:
    """Within, the page's files are asked for all the time.

    Yields:
        How often each was there, by path; an answer other than 200 is counted as `PATH: STATUS`.
    """
    counts: dict[str, int] = {}
    enough = threading.Event()

    def ask() -> None:
        with httpx.Client(base_url=service.url, trust_env=False, timeout=PATIENCE_S) as client:
            for path in cycle(paths):
                if enough.wait(_EVERY_S):
                    return
                status = client.get(path).status_code
                name = path if status == 200 else f"{path}: {status}"
                counts[name] = counts.get(name, 0) + 1

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield counts
    finally:
        enough.set()
        thread.join(PATIENCE_S)


@pytest.mark.timeout(900)  # two installations of all packages, which a crowded machine takes long for
def test_an_upgrade_disturbs_nothing(bundle: Path, prefix: Path, tmp_path: Path, loopback: Loopback) -> None:
    first = _current(prefix)
    folder = prefix / "lib/svev/versions" / first
    (page,) = folder.glob("lib/python3*/site-packages/webpanel/page")
    start = partial(
        serving, tmp_path, write_rig(tmp_path, loopback, backend="sim"), loopback,
        command=(str(prefix / "bin" / "svev"), "serve"),
        environment={"PYTHONPATH": ""},  # nothing of the checkout is found
    )  # fmt: skip
    with start() as service:
        service.arm()
        recording = service.post("/api/recordings", {"athlete": "Ola", "duration_s": 900})["id"]
        service.await_pulses(10)
        paths = _page_files(service, page)
        with _asking(service, paths) as counts:
            _damage(bundle, "numpy")
            done = _install(bundle, prefix)
            assert (done.returncode != 0, "not installed" in done.stderr) == (True, True)
            assert _current(prefix) == first
            _mend(bundle, "numpy")
            done = _install(bundle, prefix)
            assert done.returncode == 0, done.stderr
        second = _current(prefix)
        assert second != first
        assert set(counts) == set(paths), "all files were there all the time"
        pulses = service.get("/api/status")["recording"]["counts"]["pulses"]
        service.await_pulses(pulses + 10)
        service.post(f"/api/recordings/{recording}/stop")
        service.await_state("armed")
        # Processes that are started now are those of the running version, too.
        service.post("/api/disarm")
        service.await_state("idle")
        service.arm()
        assert _versions_running(service) == {first}
    verified = subprocess.run(
        [prefix / "bin" / "svev", "verify", tmp_path / "data" / f"{recording}.mcap"],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False, env={**os.environ, "PYTHONPATH": ""},
    )  # fmt: skip
    assert verified.returncode == 0, verified.stdout + verified.stderr
    with start() as service:
        service.arm()
        assert _versions_running(service) == {second}
        assert service.get("/api/recordings")


def _damage(bundle: Path, name: str) -> None:
    """Change a wheel of the bundle; the original is kept beside it."""
    (wheel,) = (bundle / "wheels").glob(f"{name}-*.whl")
    kept = wheel.rename(wheel.with_suffix(".whl.kept"))
    wheel.write_bytes(kept.read_bytes()[:-1])


def _mend(bundle: Path, name: str) -> None:
    """Undo the damage."""
    (kept,) = (bundle / "wheels").glob(f"{name}-*.whl.kept")
    kept.rename(kept.with_suffix(""))
