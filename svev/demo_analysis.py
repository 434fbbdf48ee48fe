"""Measures the jumps of the demonstration, and sets them beside the truth of the simulated hill."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from analysis.cameras.source import read_source
from analysis.procedure.analyze import analyze
from analysis.procedure.result_folder import write_folder
from analysis.report.figures import EARLY_S, plus_minus
from analysis.result.model import Jump, PulseState, Quantity, SmoothedState
from recorder.log.beside import survey_path, truth_path
from rig.errors import NoJumpError
from svev import console

#: What is shown: name in the result and in the truth, name for people, unit.
_SHOWN: Final = (
    ("alpha", "ski to leg, alpha", "°"),
    ("beta", "hip, beta", "°"),
    ("gamma", "between the skis, gamma", "°"),
    ("dphi", "right minus left ski, dphi", "°"),
    ("phi", "slope of the skis, phi", "°"),
    ("height", "height, Z0", "m"),
    ("speed", "speed, v", "m/s"),
)


@dataclass(frozen=True, slots=True)
class Comparison:
    """A number beside its truth.

    Attributes:
        name: for people.
        measured: with its standard deviation.
        true: the truth.
        unit: of both.
    """

    name: str
    measured: Quantity
    true: float
    unit: str

    def words(self) -> str:
        """One line."""
        return f"{self.name:28}{plus_minus(self.measured, self.unit):24}true {self.true:.2f}"


@dataclass(frozen=True, slots=True)
class MeasuredJump:
    """A jump beside its truth.

    Attributes:
        number: of the jump.
        verdict: on it.
        at: where its figures are of.
        figures: with their truth.
    """

    number: int
    verdict: str
    at: str
    figures: tuple[Comparison, ...]

    def to_json(self) -> dict[str, object]:
        """The jump as `svev demo --json` prints it."""
        figures = [
            {"name": each.name, **asdict(each.measured), "true": each.true, "words": each.words()}
            for each in self.figures
        ]
        return {"number": self.number, "verdict": self.verdict, "at": self.at, "figures": figures}


@dataclass(frozen=True, slots=True)
class Measured:
    """What was measured.

    Attributes:
        out: folder of the results; None: there are none.
        jumps: beside their truth.
        message: why there are no results.
    """

    out: Path | None
    jumps: tuple[MeasuredJump, ...] = ()
    message: str = ""

    @property
    def report(self) -> Path | None:
        """The page for the coach."""
        return self.out and self.out / "report.html"

    def to_json(self) -> dict[str, object]:
        """All of it as `svev demo --json` prints it."""
        return {
            "out": self.out and str(self.out),
            "report": self.report and str(self.report),
            "jumps": [jump.to_json() for jump in self.jumps],
            "message": self.message,
        }


def measure(log: Path, say: Callable[[str], None]) -> Measured:
    """Measure the jumps with the survey beside the log, write the results into a folder beside it.

    Args:
        log: of a simulated rig.
        say: prints a line for people.

    Raises:
        SvevError: as `analysis.procedure.analyze.analyze`.
    """
    folder = log.with_suffix("")
    say("measuring the jumper")
    try:
        with console.steps() as tell:
            analysis = analyze(log, read_source(survey_path(log), None), progress=tell)
            write_folder(analysis, log, folder, progress=tell)
    except NoJumpError as error:
        return Measured(None, message=str(error))
    truth = json.loads(truth_path(log).read_text(encoding="utf-8"))
    hill = {int(pulse): number for pulse, number in truth["hill_pulse_of_recording"].items()}
    states = {state["pulse"]: state for state in truth["pulses"]}
    jumps = []
    for jump in analysis.result.jumps:
        pulse = _shown_pulse(jump)
        true = {} if pulse is None else states.get(hill.get(pulse.pulse, -1), {})
        found_there = compared(pulse.smoothed, true) if pulse and pulse.smoothed and true else []
        where = "" if pulse is None else f"pulse {pulse.pulse}, {pulse.since_takeoff_s:.2f} s after the take-off"
        jumps.append(MeasuredJump(jump.number, jump.verdict.message, where, tuple(found_there)))
    return Measured(folder, tuple(jumps))


def compared(state: SmoothedState, true: Mapping[str, Any]) -> list[Comparison]:
    """The figures of a state beside the truth of its pulse."""
    found = []
    for key, name, unit in _SHOWN:
        measured = state.angles.get(key) if key in state.angles else getattr(state, key, None)
        value = true["angles"].get(key, true.get(key))
        if measured is not None and value is not None:
            found.append(Comparison(name, measured, float(value), unit))
    return found


def _shown_pulse(jump: Jump) -> PulseState | None:
    """The pulse nearest to half a second after the take-off; None if the jump has none near it."""
    if jump.takeoff is None:
        return None
    near = [pulse for pulse in jump.pulses if abs(pulse.since_takeoff_s - EARLY_S) < EARLY_S / 2]
    return min(near, key=lambda pulse: abs(pulse.since_takeoff_s - EARLY_S), default=None)
