"""Seasons drawn at random: logs that hold nothing, with results beside them as the worker writes them."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.report.course import NAMES
from season.campaign import Campaign, read_campaign
from season.rows import DISTANCES_M, Table, column_of, tables
from season.running.logs import find_logs
from season.running.outcome import LogState, Outcome, encoded, key_of
from season.running.stores import OUTCOME
from tests.season.files import campaign_file

#: True effects: standard deviations over athletes, days and jumps, degrees.
ATHLETE, DAY, JUMP, SIGMA = 2.0, 0.8, 1.5, 0.6
MEAN: Final = {"height": 3.0, "speed": 25.0}
GATES: Final = ("11", "12", "13")


@dataclass(frozen=True, slots=True)
class Drawn:
    """A season.

    Attributes:
        campaign: it.
        file: of the campaign.
        effects: by athlete, in alpha, degrees.
    """

    campaign: Campaign
    file: Path
    effects: dict[str, float]


def draw_season(
    folder: Path, *, jumps: int, athletes: int = 8, days: int = 10, years: int = 1, pulses: int = 2, seed: int = 1
) -> Drawn:
    """Draw a season with two hills, and write its logs and results.

    Args:
        folder: for all of it.
        jumps: of all athletes; each is a log.
        athletes: who jump, equally often.
        days: on which each hill is used, every year.
        years: seasons.
        pulses: of each jump.
        seed: of the draw.
    """
    rng = np.random.default_rng(seed)
    path = campaign_file(
        folder, logs=["hill"], more='[[hills]]\nname = "Other"\nlogs = ["other"]\nsurvey = "survey.json"'
    )
    names = [f"Athlete {number + 1:02}" for number in range(athletes)]
    effects = {name: float(effect) for name, effect in zip(names, rng.normal(0, ATHLETE, athletes), strict=True)}
    by_day = rng.normal(0, DAY, (years, days, 2))
    places = {}
    for number in range(jumps):
        hill, day, year = number % 2, (number // 2) % days, (number // (2 * days)) % years
        time = datetime(2024 + year, 11, 20, 9) + timedelta(days=day * 3, seconds=number * 7)
        log = folder / ("hill", "other")[hill] / f"{time:%Y-%m-%dT%H-%M-%SZ}.mcap"
        log.parent.mkdir(exist_ok=True)
        log.write_bytes(str(number).encode())
        places[str(log)] = (names[int(rng.integers(athletes))], time, by_day[year, day, hill], hill)
    campaign = read_campaign(path)
    for found in find_logs(campaign):
        athlete, time, of_day, hill = places[found.url]
        key = key_of(found.url, found.orienting.recipe)
        result = Path(found.url).with_suffix(".season")
        result.mkdir()
        outcome = Outcome(
            key=key, recipe=found.orienting.recipe, log_sha256="", stamp=found.entry.stamp, state=LogState.DONE,
            jumps=1, started=time.isoformat(timespec="seconds"), duration_s=20.0, host="drawn",
        )  # fmt: skip
        (result / OUTCOME).write_bytes(encoded(outcome))
        alpha = 40.0 + effects[athlete] + of_day + rng.normal(0, JUMP)
        _write(result, key, athlete, time, alpha, f"hill {hill}", pulses, rng)
    return Drawn(campaign, path, effects)


def _write(
    result: Path, key: str, athlete: str, time: datetime, alpha: float, calibration: str, pulses: int,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    jumps, of_pulses, cameras = tables()
    ok = rng.random() > 0.03
    row: dict[str, Any] = {
        "key": key, "jump": 1, "recording": time.strftime("%Y-%m-%dT%H-%M-%SZ"), "time_utc": time.isoformat(" "),
        "athlete": athlete, "bib": "7", "gate": GATES[int(rng.integers(3))], "ok": str(bool(ok)).lower(),
        "verdict": "good" if ok else "few points", "rate_hz": 30, "pulses": pulses, "takeoff_pulse": 17,
        "takeoff_sigma_pulses": 0.1, "perpendicular_m_per_s": round(rng.normal(2.2, 0.1), 3),
        "perpendicular_sigma_m_per_s": 0.05, "calibration": calibration,
    }  # fmt: skip
    for distance in DISTANCES_M:
        for name in NAMES:
            value = alpha if name == "alpha" else rng.normal(MEAN.get(name, 20.0), 1.0)
            row[column_of(name, distance)] = f"{value + rng.normal(0, SIGMA):.4f}"
            row[column_of(name, distance, sigma=True)] = SIGMA
    _table(result, jumps, [row])
    _table(
        result, of_pulses, [{"key": key, "jump": 1, "pulse": number + 1, "phase": "flight"} for number in range(pulses)]
    )
    drift = (time - datetime(2024, 11, 20)).days * 1e-4
    _table(result, cameras, [
        {"key": key, "recording": row["recording"], "camera": name,
         "X0_X_m": 10.0 * place + drift + rng.normal(0, 0.002), "X0_Y_m": 1.0, "X0_Z_m": 2.0,
         **{f"X0_{axis}_sigma_m": 0.002 for axis in "XYZ"},
         **{f"R{i}{j}": float(i == j) for i in range(1, 4) for j in range(1, 4)},
         **{f"angle_{axis}_sigma_deg": 0.01 for axis in "xyz"}, "offset_ms": 0.0, "offset_sigma_ms": 0.1}
        for place, name in enumerate(("K1", "K2", "K3"))
    ])  # fmt: skip


def _table(result: Path, table: Table, rows: Sequence[dict[str, Any]]) -> None:
    with (result / table.file).open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(table.columns), restval="")
        writer.writerows(rows)
