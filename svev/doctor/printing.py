"""Prints findings of the doctor for people, by topic, and ends the command by the worst of them."""

from collections.abc import Sequence
from itertools import groupby
from typing import Final

import typer

from svev import console
from svev.doctor.finding import Finding, Level

_STYLES: Final = {Level.PASS: "green", Level.WARN: "yellow", Level.FAIL: "bold red"}
_SOMETHING_FAILS: Final = 3


def counts_of(findings: Sequence[Finding]) -> dict[Level, int]:
    """How many findings there are by level."""
    return {level: sum(finding.level is level for finding in findings) for level in Level}


def print_findings(findings: Sequence[Finding]) -> None:
    """Print findings with their marks, and how many there are of each."""
    for topic, group in groupby(findings, key=lambda finding: finding.topic):
        console.say(topic)
        for finding in group:
            remedy = f" -> {finding.remedy}" if finding.remedy else ""
            console.say_marked(finding.level, _STYLES[finding.level], finding.what + remedy)
    console.say(", ".join(f"{count} {level}" for level, count in counts_of(findings).items()))


def end_with(findings: Sequence[Finding]) -> None:
    """End the command with exit code 3 if something fails."""
    if any(finding.level is Level.FAIL for finding in findings):
        raise typer.Exit(_SOMETHING_FAILS)
