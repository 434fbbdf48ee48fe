"""The fixtures of all rooms' tests, as a pytest plugin (so that they can be tested themselves)."""

import gc
import os
import shutil
import tempfile
import uuid
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

from rig.transport.launcher import end_launcher, launcher
from tests.support import cost, processes, reliability
from tests.support import loopback as loopback_blocks
from tests.support.leaks import Leaks, Snapshot, await_nothing_left
from tests.support.loopback import Loopback

#: GLib and ZeroMQ keep a few event descriptors from their first use on.
_SPARE_EVENTS_TEST = 2
_SPARE_EVENTS_SESSION = 8

_failed = pytest.StashKey[bool]()

# The same examples at every run: a change is judged by what it changes. For new ones: --hypothesis-profile=explore
# No example has a deadline, and none is too slow: on a crowded machine that says nothing about the code.
_UNTIMED = hypothesis.settings(deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.register_profile("repeatable", _UNTIMED, derandomize=True)
hypothesis.settings.register_profile("explore", _UNTIMED, derandomize=False)
hypothesis.settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of our own."""
    parser.addoption("--hardware", action="store_true", help="also run the tests that need real cameras")
    parser.addoption(
        "--write-reliability", action="store_true", help="write the table of docs/explanation/reliability.md"
    )
    parser.addoption("--cost", action="store_true", help="show the CPU-seconds of tests with all that they started")
    parser.addoption("--leak-grace", type=float, default=2.0, help="seconds that what a test started has to go away")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Those that may take longest begin first; without --hardware those that need real cameras are skipped.

    Raises:
        UsageError: one marked `alone` is not marked `long`: `make test` would run it beside the others.
    """
    usual_s = float(config.getini("timeout") or 0)

    def most_s(item: pytest.Item) -> float:
        marker = item.get_closest_marker("timeout")
        return max(usual_s, *map(float, marker.args)) if marker is not None else usual_s

    # Otherwise one that takes minutes begins last, and the other workers have nothing left to do.
    items.sort(key=most_s, reverse=True)
    for item in items:
        if item.get_closest_marker("alone") and not item.get_closest_marker("long"):
            raise pytest.UsageError(f"{item.nodeid} is marked alone but not long: mark it long as well")
    if config.getoption("--hardware"):
        return
    for item in items:
        if item.get_closest_marker("hardware"):
            item.add_marker(pytest.mark.skip(reason="needs real cameras; run with --hardware"))


class _LeftOut:
    """Counts the long tests that were left out, by folder, in the workers, and says so at the end."""

    _COUNTS = "long tests left out"

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._counts: dict[str, int] = {}

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        for item in items:
            if item.get_closest_marker("long"):
                folder = cost.folder_of(item.nodeid)
                self._counts[folder] = self._counts.get(folder, 0) + 1

    def pytest_sessionfinish(self) -> None:
        output = getattr(self._config, "workeroutput", None)
        if output is not None:
            output[self._COUNTS] = self._counts

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: object) -> None:
        self._counts = getattr(node, "workeroutput", {}).get(self._COUNTS, self._counts)  # all workers collect the same

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._counts and "not long" in self._config.option.markexpr:
            folders = ", ".join(f"{folder} {count}" for folder, count in sorted(self._counts.items()))
            total = sum(self._counts.values())
            terminalreporter.write_line(f"left out: {total} long tests, which `make test-long` runs ({folders})")


class _ReliabilityWriter:
    """Collects the rows that tests tell, in the process that starts the workers."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        reliability.note(self._config, report)

    def pytest_sessionfinish(self) -> None:
        reliability.write(self._config)


def pytest_configure(config: pytest.Config) -> None:
    """Measure what tests cost, say what is left out, and with --write-reliability write the table of faults anew."""
    config.pluginmanager.register(cost.Meter())
    config.pluginmanager.register(_LeftOut(config))
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(cost.Ledger(config))
    if config.getoption("--write-reliability") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_ReliabilityWriter(config))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage meanwhile: nearly all that importing and collecting make stays, and looking takes a sixth."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish() -> None:
    """Let the garbage collector leave alone what stays until the end: the modules, and thousands of tests."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Remember whether the test itself failed: its traceback then keeps things alive that are no leak."""
    report = yield
    if isinstance(report, pytest.TestReport) and report.when != "teardown" and report.failed:
        item.stash[_failed] = True
    return report


@pytest.fixture(scope="session", autouse=True)
def run_token(request: pytest.FixtureRequest) -> Iterator[str]:
    """Marks every process that this run starts; at its end nothing may be left (after failures: no process)."""
    token = uuid.uuid4().hex
    os.environ[processes.TOKEN_VARIABLE] = token
    with processes.shared_from_now_on(token):
        launcher()
    before = Snapshot.take(token)
    yield token
    end_launcher()
    grace_s: float = request.config.getoption("--leak-grace")
    whole = not request.session.testsfailed
    _complain("the test session", await_nothing_left(before, token, grace_s, _SPARE_EVENTS_SESSION, all_kinds=whole))
    del os.environ[processes.TOKEN_VARIABLE]


@pytest.fixture(autouse=True)
def _nothing_left_behind(request: pytest.FixtureRequest, run_token: str) -> Iterator[None]:
    """After every test: no process, thread, socket, file or shared memory more than before it.

    The launcher is no test's own. On a crowded machine it may answer so late that a test starts another one.
    """
    shared = launcher().pid
    processes.share(shared)
    before = Snapshot.take(run_token)
    yield
    if launcher().pid != shared:
        end_launcher()  # the next test begins with one
    grace_s: float = request.config.getoption("--leak-grace")
    whole = not request.node.stash.get(_failed, False)
    _complain(request.node.name, await_nothing_left(before, run_token, grace_s, _SPARE_EVENTS_TEST, all_kinds=whole))


def _complain(who: str, left: Leaks) -> None:
    if not left:
        return
    for process in left.processes:
        processes.end(process)
    pytest.fail(f"{who} left behind (close or stop it in the test, best in a with block):\n{left}", pytrace=False)


@pytest.fixture(scope="session")
def loopback(worker_id: str) -> Iterator[Loopback]:
    """This worker's own block of loopback addresses."""
    number = 0 if worker_id == "master" else int(worker_id.removeprefix("gw"))
    with loopback_blocks.claim(number) as block:
        yield block


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder with a short path: a Unix socket's has at most 107 characters."""
    folder = Path(tempfile.mkdtemp(prefix="svev"))
    yield folder
    shutil.rmtree(folder)
