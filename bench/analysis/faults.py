"""What the analysis says of faults: each should be one clear line, and nothing invented."""

import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from analysis.cameras.source import read_source
from analysis.procedure.analyze import Analysis, analyze
from bench.analysis.hill_logs import HillLog, write_hill_log
from bench.analysis.judge import Judged
from bench.analysis.jumps import PULSES, scenario_of
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from rig.errors import SvevError
from simrig.world.scenario import Scenario

_SEED: Final = 77
_KNOCK_S: Final = 1.2  # scene time at which a camera is knocked: in flight


def run_faults(only: str = "") -> list[dict[str, Any]]:
    """Analyze a jump with each fault.

    Args:
        only: part of a name; others are left out.

    Returns:
        Cases with name, exit code of `svev analyze`, what it said, and the figures of `Judged`.
    """
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as folder:
        return [_case(name, make(Path(folder))) for name, make in _FAULTS.items() if only in name]


def _case(name: str, log: HillLog) -> dict[str, Any]:
    judged = Judged()
    code, said = 0, []
    try:
        analysis = analyze(log.path, read_source(log.survey, None))
        said = _said(analysis)
        for jump in analysis.result.jumps:
            judged.jump(jump, log.truth)
    except NotSolvableError as error:
        code, said = 3, [str(error)]
    except NotConvergedError as error:
        code, said = 4, [str(error)]
    except SvevError as error:
        code, said = error.exit_code, [str(error)]
    log.path.unlink()
    figures = judged.figures()
    figures.pop("honesty")
    return {"name": name, "code": code, "said": said, **figures}


def _said(analysis: Analysis) -> list[str]:
    result = analysis.result
    lines = [move.message for move in result.orientation.moved]
    lines += [offset.message for offset in result.synchrony.values() if offset.message is not None]
    lines += [message for message in result.orientation.messages if "surveyed balls in sight named" not in message]
    return [*lines, *(f"jump {jump.number}: {jump.verdict.message}" for jump in result.jumps)]


def _with_camera(name: str, **changes: Any) -> Scenario:
    """The training scenario with another setting of one camera."""
    scenario = scenario_of("training", _SEED)
    cameras = [c.model_dump() | (changes if c.name == name else {}) for c in scenario.cameras]
    return Scenario.model_validate(scenario.model_dump() | {"cameras": cameras})


def _late(milliseconds: float) -> Callable[[Path], HillLog]:
    return lambda folder: write_hill_log(folder / "late", _with_camera("K2", late_ms=milliseconds), PULSES)


def _knocked(folder: Path) -> HillLog:
    moves = ({"from_s": _KNOCK_S, "rotation_deg": [0.0, 0.05, 0.0]},)
    return write_hill_log(folder / "knocked", _with_camera("K2", moves=moves), PULSES)


def _surveyed(change: Callable[[dict[str, Any]], None], name: str) -> Callable[[Path], HillLog]:
    """A log whose survey is wrong."""

    def make(folder: Path) -> HillLog:
        log = write_hill_log(folder / name, scenario_of("training", _SEED), PULSES)
        survey = json.loads(log.survey.read_text(encoding="utf-8"))
        change(survey)
        log.survey.write_text(json.dumps(survey), encoding="utf-8")
        return log

    return make


def _wrong_ball(survey: dict[str, Any]) -> None:
    survey["points"]["B7"]["X"][1] += 0.2


def _swapped_balls(survey: dict[str, Any]) -> None:
    points = survey["points"]
    points["B5"]["X"], points["B12"]["X"] = points["B12"]["X"], points["B5"]["X"]


def _wrong_size(survey: dict[str, Any]) -> None:
    survey["cameras"]["K1"]["size"] = [1280, 960]


def _other_hill(survey: dict[str, Any]) -> None:
    """Balls of another hill: mirrored, so that no motion brings them to where they are."""
    for point in survey["points"].values():
        point["X"][1] = -point["X"][1]


def _without_camera(folder: Path) -> HillLog:
    scenario = scenario_of("training", _SEED)
    two = scenario.model_copy(update={"cameras": scenario.cameras[:2]})
    return write_hill_log(folder / "two", two, PULSES)


def _heavy_snow(folder: Path) -> HillLog:
    scenario = scenario_of("training", _SEED)
    weather = scenario.weather.model_copy(update={"snowfall": 1.0})
    return write_hill_log(folder / "snow", scenario.model_copy(update={"weather": weather}), PULSES)


def _nobody(folder: Path) -> HillLog:
    return write_hill_log(folder / "nobody", scenario_of("training", _SEED), range(70, 100))


def _cut(folder: Path) -> HillLog:
    """A log that was cut off in the middle, as by a power failure."""
    log = write_hill_log(folder / "whole", scenario_of("training", _SEED), PULSES)
    cut = folder / "cut.mcap"
    shutil.copyfile(log.path, cut)
    with cut.open("r+b") as file:
        file.truncate(log.path.stat().st_size * 6 // 10)
    log.path.unlink()
    return HillLog(cut, log.survey, log.truth)


def _clean(folder: Path) -> HillLog:
    return write_hill_log(folder / "clean", scenario_of("training", _SEED), PULSES)


_FAULTS: Final[dict[str, Callable[[Path], HillLog]]] = {
    "none": _clean,
    "two cameras": _without_camera,
    "K2 shows one frame later": _late(1000 / 30),
    "K2 shows 8 ms later": _late(8.0),
    "K2 turned by 0.05 degrees in flight": _knocked,
    "a ball surveyed 0.2 m wrong": _surveyed(_wrong_ball, "wrong-ball"),
    "the names of two balls swapped": _surveyed(_swapped_balls, "swapped"),
    "survey for another image size": _surveyed(_wrong_size, "size"),
    "survey of another hill": _surveyed(_other_hill, "other"),
    "dense snow": _heavy_snow,
    "nobody jumps": _nobody,
    "log cut off": _cut,
}
