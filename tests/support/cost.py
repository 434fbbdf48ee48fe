"""What tests cost: CPU-seconds of each test with all processes that it started. Kept always, shown by `--cost`.

Seconds of the wall clock say how busy the machine was; CPU-seconds say what a test does. What a shared fixture costs is
counted for the test that used it first.
"""

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping

import pytest

from tests.support.processes import TOKEN_VARIABLE, all_processes

_PROPERTY = "cpu_s"
_KEPT = "svev/cost"
_SHOWN = 40
_OWN_TICKS_PER_S = os.sysconf("SC_CLK_TCK")

_begun = pytest.StashKey[float]()


def used_cpu_s() -> float:
    """CPU-seconds that this process, the children that it waited for, and all that still run have used until now."""
    times = os.times()
    token = os.environ.get(TOKEN_VARIABLE)
    running = sum(process.cpu_ticks for process in all_processes(token)) if token else 0
    return sum(times[:4]) + running / _OWN_TICKS_PER_S


class Meter:
    """Measures each test, in the process that runs it."""

    def __init__(self) -> None:
        self._used_s: float | None = None  # when the last test had ended

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Look at the clock before the test's fixtures are made."""
        item.stash[_begun] = used_cpu_s() if self._used_s is None else self._used_s
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        """Note what the test has cost once its fixtures are gone."""
        report = yield
        if isinstance(report, pytest.TestReport) and report.when == "teardown":
            # What a process has used is forgotten if it ends and nobody waits for it, as a browser's children may.
            self._used_s = used_cpu_s()
            report.user_properties.append((_PROPERTY, max(0.0, self._used_s - item.stash[_begun])))
        return report

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Tell the process that started the workers what this one has used in all."""
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output[_PROPERTY] = used_cpu_s()


class Ledger:
    """Collects what tests have cost, in the process that starts the workers, and keeps it in pytest's cache."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._costs: dict[str, float] = {}
        self._lasted: dict[str, float] = defaultdict(float)
        self._workers_s = 0.0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take what a test has cost, and how long it has lasted with its fixtures."""
        self._lasted[report.nodeid] += report.duration
        for name, value in report.user_properties:
            if name == _PROPERTY:
                self._costs[report.nodeid] = float(str(value))

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: object) -> None:
        """Take what a worker has used."""
        self._workers_s += getattr(node, "workeroutput", {}).get(_PROPERTY, 0.0)

    def pytest_sessionfinish(self) -> None:
        """Keep it."""
        cache = getattr(self._config, "cache", None)
        if cache is not None and self._costs:
            known = cache.get(_KEPT, {})  # of runs of other tests
            cache.set(_KEPT, known | {name: round(cost, 2) for name, cost in self._costs.items()})

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """With --cost: folders and tests, the dearest first."""
        if not self._costs or not self._config.getoption("--cost"):
            return
        terminalreporter.section("CPU-seconds, with all processes that tests started")
        own_s = sum(os.times()[:4]) if not self._workers_s else sum(os.times()[:2])
        terminalreporter.write_line(f"{self._workers_s + own_s:8.0f} s  in all, with imports and collection")
        for name, cost in _dearest(_by_folder(self._costs)):
            terminalreporter.write_line(f"{cost:8.1f} s  {name}")
        terminalreporter.write_line("")
        for name, cost in _dearest(self._costs)[:_SHOWN]:
            terminalreporter.write_line(f"{cost:8.1f} s  {name}")
        terminalreporter.write_line("")
        terminalreporter.write_line("waited: seconds of the wall clock beyond those")
        waited = {name: self._lasted[name] - cost for name, cost in self._costs.items()}
        for name, seconds in [*_dearest(_by_folder(waited)), *_dearest(waited)[:_SHOWN]]:
            terminalreporter.write_line(f"{seconds:8.1f} s  {name}")


def folder_of(nodeid: str) -> str:
    """The folder of `tests` in which a test lies, e.g. `tests/rig`."""
    return "/".join(nodeid.partition("::")[0].split("/")[:2])


def _by_folder(costs: Mapping[str, float]) -> Mapping[str, float]:
    folders: dict[str, float] = defaultdict(float)
    counts: dict[str, int] = defaultdict(int)
    for name, cost in costs.items():
        folder = folder_of(name)
        folders[folder] += cost
        counts[folder] += 1
    return {f"{folder} ({counts[folder]} tests)": cost for folder, cost in folders.items()}


def _dearest(costs: Mapping[str, float]) -> list[tuple[str, float]]:
    return sorted(costs.items(), key=lambda item: -item[1])
