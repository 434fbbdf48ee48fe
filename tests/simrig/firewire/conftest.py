import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from rig.settings.file import CONFIG
from simrig.programs.simulated_hill import SimulatedHill

TRAINING = CONFIG / "scenarios" / "training.toml"
ROOT = Path(__file__).parents[3]
RATE_HZ = 30.0
GUIDS = {f"K{number}": f"000a4701011b000{number}" for number in (1, 2, 3, 4)}


class RefusedError(Exception):
    """libdc1394 returned an error code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class Program:
    """A process on the emulated bus (`tests.simrig.firewire.client`), told what to do."""

    def __init__(self, environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.simrig.firewire.client"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, cwd=ROOT, env={**os.environ, **environment},
        )  # fmt: skip

    def begin(self, method: str, *arguments: Any) -> None:
        """Say what to do, without waiting for the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([method, arguments]) + "\n")
        self.process.stdin.flush()

    def result(self) -> Any:
        """The answer."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, "the program on the bus has died"
        answer = json.loads(line)
        if "error" in answer:
            raise RefusedError(answer["error"], answer["code"])
        return answer["result"]

    def __call__(self, method: str, *arguments: Any) -> Any:
        """Say what to do and wait for the answer."""
        self.begin(method, *arguments)
        return self.result()

    def close(self) -> None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()


StartHill = Callable[..., SimulatedHill]
StartProgram = Callable[..., Program]


@pytest.fixture
def start_hill(tmp_path: Path) -> Iterator[StartHill]:
    """Starts a bus with so many cameras; `toml` is added to the training scenario."""
    with ExitStack() as hills:

        def start(cameras: int = 1, toml: str = "", **options: Any) -> SimulatedHill:
            scenario = tmp_path / "scenario.toml"
            scenario.write_text(f'base = "{TRAINING}"\n{toml}')
            names = dict(list(GUIDS.items())[:cameras])
            given = {"test_pattern": True, **options}
            return hills.enter_context(SimulatedHill(scenario, {}, RATE_HZ, firewire=names, **given))

        yield start


@pytest.fixture
def start_program() -> Iterator[StartProgram]:
    """Starts a program that sees a hill's bus; with the name of a camera, opens and configures that."""
    with ExitStack() as programs:

        def start(hill: SimulatedHill, camera: str = "") -> Program:
            program = Program(hill.environment)
            programs.callback(program.close)
            if camera:
                program("open", GUIDS[camera])
                program("configure")
            return program

        yield start
