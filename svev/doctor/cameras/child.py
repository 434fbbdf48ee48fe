"""Hears what a child process of the doctor finds, so that a hanging camera or card does not hang the doctor."""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import IO

from rig.settings.model import RigSettings
from rig.transport.message import Message
from rig.transport.process_table import Child, ProcessSpec
from svev.doctor.finding import Finding


class Found(Message):
    """One finding."""

    finding: Finding


class Trial(Message):
    """What `svev.doctor.cameras.gige_trial` is told.

    Attributes:
        rig: the rig.
        names: of the cameras that are tried.
    """

    rig: RigSettings
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Heard:
    """What a child process has said.

    Attributes:
        findings: what it found; empty if it hung.
        hangs: it had not ended in time.
        broken: the last line of its output, if it ended otherwise than it should; else empty.
    """

    findings: list[Finding]
    hangs: bool = False
    broken: str = ""


def hear(name: str, module: str, config: Message, limit_s: float, variables: Mapping[str, str]) -> Heard:
    """Run a program that reports `Found`, and end it.

    Args:
        name: of the process in messages.
        module: the program.
        config: what it is told.
        limit_s: how long it may take, s.
        variables: more of its environment.
    """
    with tempfile.TemporaryFile() as output:
        child = Child(ProcessSpec(name, module, config, environment=variables, reports=Found, output=output))
        try:
            findings = _findings(child, time.monotonic() + limit_s)
        finally:
            child.kill()
        if findings is None:
            return Heard([], hangs=True)
        return Heard(findings, broken="" if child.ending() == "exit code 0" else _last_line(output))


def _findings(child: Child, deadline: float) -> list[Finding] | None:
    """All findings of the child; None if it has not ended at the deadline."""
    findings = []
    while (found := child.control.next(deadline - time.monotonic())) is not None:
        findings.append(found.finding)
    ended = child.control.ended and child.wait(max(0.0, deadline - time.monotonic()))
    return findings if ended else None


def _last_line(output: IO[bytes]) -> str:
    output.seek(0)
    lines = output.read().decode("utf-8", "replace").strip().splitlines()
    return lines[-1] if lines else "no reason given"
