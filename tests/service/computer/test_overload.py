"""A computer that is too slow for the cameras is called that; no cable is accused."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from rig.clocks import NS_PER_S, DecimalNs
from rig.health import CameraHealth, CameraPairing, DiskHealth, Health, Latency, PairingHealth, PrerollHealth
from service.supervision.overload import Overload, Waits, waits_of
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

PIDS = {"K1": 1, "K2": 2, "K3": 3, "recorder": 4}


def _health(lost: tuple[int, int, int]) -> Health:
    """A record in which the cameras have lost so many frames so far."""
    cameras = [CameraHealth(name, True, 30, 0.0, None, 900, 0, 0, 0, 0, 0, 0, 0, 0) for name in ("K1", "K2", "K3")]
    paired = [
        CameraPairing(
            lost=count, connected=True, silent=False, clock_known=True, clock_offset_ns=DecimalNs(0),
            clock_drift_ppm=0.0, clock_uncertainty_us=1.0, latency_ms=5.0,
        )
        for count in lost
    ]  # fmt: skip
    pairing = PairingHealth(900, 0, 0, 4, 33333.3, 1.0, 2.0, False, tuple(paired))
    preroll = PrerollHealth(5.0, 5.0, 150, 100.0)
    return Health(tuple(cameras), pairing, 60, 0, preroll, None, DiskHealth(10**10), Latency({"+Inf": 0}, 0.0, 0))


def _looked(waiting: tuple[int, ...], losing: tuple[int, ...], seconds: int = 3) -> Overload:
    """After some seconds in which these processes wait 0.6 s of each second, and these cameras lose frames."""
    second = 0

    def measure(pid: int) -> Waits:
        waited = NS_PER_S * 6 // 10 if pid in waiting else NS_PER_S // 100
        return {pid * 10: (second * NS_PER_S // 5, second * waited)}

    overload = Overload(NS_PER_S // 30, measure)
    for second in range(seconds):
        health = _health(tuple(second * (camera in losing) for camera in range(3)))  # type: ignore[arg-type]
        overload.look(health, PIDS, 100.0 + second)
    return overload


@pytest.mark.parametrize(
    ("waiting", "losing", "found"),
    [
        ((1, 2, 3), (0, 1, 2), (0, 1, 2)),
        ((4,), (0, 2), (0, 2)),
        ((), (0, 1, 2), ()),  # something else: the network, the disk
        ((1, 2, 3), (1,), ()),  # a single camera may as well have a bad cable
        ((1, 2, 3), (), ()),  # a busy computer that does no harm
    ],
)
def test_the_computer_is_named_if_several_cameras_lose_frames_and_their_processes_wait(
    waiting: tuple[int, ...], losing: tuple[int, ...], found: tuple[int, ...]
) -> None:
    assert _looked(waiting, losing).cameras == found


def test_it_is_over_some_seconds_after_the_last_trouble() -> None:
    overload = _looked((1, 2), (0, 1))
    overload.look(_health((2, 2, 0)), PIDS, 104.0)
    assert list(overload.cameras) == [0, 1]
    overload.look(_health((2, 2, 0)), PIDS, 110.0)
    assert not overload.cameras


@contextmanager
def _busy_processor(processor: int, pids: list[int]) -> Iterator[None]:
    """Within, these processes get what a busy loop leaves of one processor: next to nothing."""
    own = os.sched_getaffinity(0)
    loop = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        os.sched_setaffinity(loop.pid, {processor})
        for pid in pids:
            for task in Path(f"/proc/{pid}/task").iterdir():
                os.sched_setaffinity(int(task.name), {processor})
                os.sched_setscheduler(int(task.name), os.SCHED_IDLE, os.sched_param(0))
        yield
    finally:
        loop.kill()
        loop.wait(10)
        for pid in pids:
            for task in Path(f"/proc/{pid}/task").glob("*"):
                with suppress(PermissionError, ProcessLookupError):  # not root, or the thread has ended
                    os.sched_setaffinity(int(task.name), own)
                    os.sched_setscheduler(int(task.name), os.SCHED_OTHER, os.sched_param(0))


def test_on_an_overloaded_processor_the_computer_is_said_to_be_too_slow(tmp_path: Path, loopback: Loopback) -> None:
    if not waits_of(os.getpid()):
        pytest.skip("this kernel does not measure how long threads wait for a processor")
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        service.await_cameras("ready", "ready", "ready")
        pids = service.pids()
        processor = min(os.sched_getaffinity(0))
        with _busy_processor(processor, [pids[name] for name in ("K1", "K2", "K3")]):
            wait_until(
                lambda: service.get("/api/status")["statement"]["code"].endswith("_overloaded"),
                "the computer is called too slow", PATIENCE_S, 0.05,
            )  # fmt: skip
            status = service.get("/api/status")
        assert "this computer is too slow: frames of K" in status["statement"]["text"]
        assert "close other programs" in status["statement"]["advice"]
        assert not any("cable" in camera["statement"]["advice"] for camera in status["cameras"])
        assert "computer: too slow: frames of K" in service.log.read_text()
