"""A published self-calibration (DBAT's camcaldemo), to every digit within the tolerances of `expected.json`."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from svev.cli import main

_DATA = Path(__file__).parents[1] / "data" / "camcal"
_EXPECTED: dict[str, Any] = json.loads((_DATA / "expected.json").read_text())


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("camcal")
    assert (
        main(["adjust", str(_DATA / "network.json"), "--force", "-o", str(folder / "result.json")]) == _EXPECTED["exit"]
    )
    read: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return read


def _derived(result: dict[str, Any], path: str) -> float:
    """A figure of `expected.json`: a path into the result, or one of the few that are derived from it."""
    match path.split("."):
        case ["sqrt_vTPv"]:
            return math.sqrt(result["vTPv"])
        case ["worst_residual"]:
            return max(math.hypot(o["vx"], o["vy"]) for o in result["observations"])
        case ["max_sigma_X", axis]:
            return float(max(point["sigma"][int(axis)] for point in result["points"].values()))
        case ["angles_deg", image, angle]:
            r = np.array(result["images"][image]["R"])
            angles = {
                "omega": math.atan2(-r[1, 2], r[2, 2]),
                "phi": math.asin(r[0, 2]),
                "kappa": math.atan2(-r[0, 1], r[0, 0]),
            }
            return math.degrees(angles[angle])
        case parts:
            value: Any = result
            for part in parts:
                value = value[int(part)] if isinstance(value, list) else value[part]
            return float(value)


@pytest.mark.parametrize("path", list(_EXPECTED["figures"]))
def test_published_figure(result: dict[str, Any], path: str) -> None:
    figure = _EXPECTED["figures"][path]
    assert _derived(result, path) == pytest.approx(figure["value"], rel=0.0, abs=figure["tolerance"])


def test_largest_residual_is_where_it_was_published(result: dict[str, Any]) -> None:
    worst = max(result["observations"], key=lambda o: math.hypot(o["vx"], o["vy"]))
    assert [worst["image"], worst["point"]] == _EXPECTED["worst_residual_at"]


def test_redundancy_numbers_add_up(result: dict[str, Any]) -> None:
    total = sum(o["rx"] + o["ry"] for o in result["observations"])
    assert total == pytest.approx(result["redundancy"], abs=1e-6)
