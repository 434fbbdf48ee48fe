"""Real-time scheduling of the grabbers."""

import os
import subprocess
import sys

import pytest

_PROGRAM = """
import os, sys, threading
from service.processes.priority import allowed_priority, prefer_this_process
allowed = allowed_priority() if sys.argv[1] == "limit" else int(sys.argv[1])
try:
    done = prefer_this_process(allowed)
except PermissionError:
    raise SystemExit("not permitted")
seen = []
thread = threading.Thread(target=lambda: seen.append(os.sched_getscheduler(0)))
thread.start()
thread.join(10)
print(done, seen[0], os.sched_getparam(0).sched_priority)
"""


def _run(allowed: str) -> str:
    command = [sys.executable, "-c", _PROGRAM, allowed]
    result = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    if "not permitted" in result.stderr:
        pytest.skip("real-time scheduling needs root or a limit: ulimit -r 20")
    assert not result.stderr
    return result.stdout.strip()


def test_without_a_limit_nothing_changes_even_for_root() -> None:
    assert _run("0") == f"False {os.SCHED_OTHER} 0"


def test_threads_to_come_run_in_real_time_too() -> None:
    assert _run("5") == f"True {os.SCHED_FIFO} 5"


def test_no_priority_above_the_kernels_interrupt_threads() -> None:
    assert _run("99") == f"True {os.SCHED_FIFO} 10"
