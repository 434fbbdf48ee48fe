"""Athletes, days and hills at once: a linear model with mixed effects, by statsmodels.

    value = mean + hill + athlete + day on the hill + rest

Hills are fixed effects, against the first of them; athletes and days are random ones, whose standard deviations are
estimated by REML. An athlete's effect is its best linear unbiased prediction: the fewer the jumps, the more it is
shrunk to the mean.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Final

import duckdb
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rig.errors import BadInputError
from season.rows import column_of
from season.tables.comparison import refuse_unknown
from season.tables.database import asked

#: What the model needs, at least.
FEWEST_JUMPS: Final = 30
FEWEST_ATHLETES: Final = 3
FEWEST_DAYS: Final = 4
_SQL: Final = """
    SELECT hill, athlete, hill || ' ' || day AS day, {value}, {sigma} FROM jumps
    WHERE ok AND athlete IS NOT NULL AND {value} IS NOT NULL ORDER BY time_utc
"""


class TooLittleError(BadInputError):
    """The jumps do not tell the effects apart."""


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect.

    Attributes:
        name: of athlete or hill.
        jumps: of it.
        value: of the effect, in the quantity's unit.
        sigma: its standard deviation.
    """

    name: str
    jumps: int
    value: float
    sigma: float

    @property
    def is_large(self) -> bool:
        """Whether it is beyond twice its standard deviation."""
        return abs(self.value) > 2 * self.sigma


@dataclass(frozen=True, slots=True)
class MixedEffects:
    """The fitted model.

    Attributes:
        jumps: that went into it.
        mean: of all athletes on the first hill, with its standard deviation.
        hills: against the first one.
        athletes: against their mean, from the largest to the smallest.
        first_hill: its name.
        sd_athletes, sd_days, sd_rest: standard deviations of athletes, of days, and of jumps of one athlete on one day.
        sigma: root mean square of the jumps' standard deviations of measurement; `sd_rest` includes them.
    """

    jumps: int
    mean: Effect
    hills: list[Effect]
    athletes: list[Effect]
    first_hill: str
    sd_athletes: float
    sd_days: float
    sd_rest: float
    sigma: float


def mixed_effects(database: duckdb.DuckDBPyConnection, quantity: str, distance_m: int) -> MixedEffects:
    """Fit the model to all good jumps.

    Args:
        database: the tables.
        quantity: of `analysis.report.course.NAMES`.
        distance_m: one of `DISTANCES_M`.

    Raises:
        BadInputError: there is no such quantity or distance.
        TooLittleError: the jumps do not tell the effects apart, or the fit does not converge; the message says why.
    """
    refuse_unknown(quantity, distance_m)
    value, sigma = column_of(quantity, distance_m), column_of(quantity, distance_m, sigma=True)
    rows = asked(database, _SQL.format(value=value, sigma=sigma))[1]
    hill, athlete, day = (np.array([row[place] for row in rows], dtype=object) for place in range(3))
    values, sigmas = (np.array([row[place] for row in rows], float) for place in (3, 4))
    _refuse_too_little(hill, athlete, day)
    fit = _fitted(hill, athlete, day, values)
    hills = sorted(set(hill))
    parts = dict(zip(fit.model.exog_vc.names, fit.vcomp, strict=True))

    def fixed(at: int, name: str) -> Effect:
        jumps = len(values) if at == 0 else int(np.count_nonzero(hill == name))
        return Effect(name, jumps, float(fit.fe_params.iloc[at]), float(fit.bse_fe.iloc[at]))

    return MixedEffects(
        jumps=len(values),
        mean=fixed(0, "mean"),
        hills=[fixed(at, name) for at, name in enumerate(hills) if at],
        athletes=_athletes(fit, athlete),
        first_hill=hills[0],
        sd_athletes=_root(parts["athlete"]),
        sd_days=_root(parts["day"]),
        sd_rest=_root(fit.scale),
        sigma=float(np.sqrt(np.nanmean(sigmas**2))),
    )


def _root(variance: float) -> float:
    return math.sqrt(max(0.0, float(variance)))


def _refuse_too_little(hill: Any, athlete: Any, day: Any) -> None:
    """Refuse jumps that cannot tell the effects apart.

    Raises:
        TooLittleError: why.
    """
    for count, fewest, what in (
        (len(hill), FEWEST_JUMPS, "good jumps"),
        (len(set(athlete)), FEWEST_ATHLETES, "athletes"),
        (len(set(day)), FEWEST_DAYS, "days"),
    ):
        if count < fewest:
            raise TooLittleError(f"there are {count} {what}, and effects need {fewest}: measure more logs")
    (_, who), (_, when) = np.unique(athlete, return_inverse=True), np.unique(day, return_inverse=True)
    athletes, days = int(who.max()) + 1, int(when.max()) + 1
    size = athletes + days
    together = coo_array((np.ones(len(who)), (who, athletes + when)), shape=(size, size))
    parts, part = connected_components(together, directed=False)
    if parts > 1:
        apart = next(name for name, place in zip(athlete, part[who], strict=True) if place != part[who[0]])
        raise TooLittleError(
            f"{athlete[0]} and {apart} share no day, nor days with others who do: athletes and days cannot be told "
            "apart; compare those who jumped together by svev season query --ask athletes"
        )
    if len(set(zip(who, when, strict=True))) == len(who):
        raise TooLittleError(
            "nobody jumped twice on a day: the scatter of jumps cannot be told from that of days; measure more logs"
        )


def _fitted(hill: Any, athlete: Any, day: Any, values: Any) -> Any:
    # They take a second to be imported, and only this needs them.
    import pandas as pd  # noqa: PLC0415
    from statsmodels.formula.api import mixedlm  # noqa: PLC0415
    from statsmodels.tools.sm_exceptions import ConvergenceWarning  # noqa: PLC0415

    frame = pd.DataFrame({"value": values, "hill": hill, "athlete": athlete, "day": day, "whole": 1})
    formula = "value ~ C(hill)" if len(set(hill)) > 1 else "value ~ 1"
    parts = {"athlete": "0 + C(athlete)", "day": "0 + C(day)"}
    model = mixedlm(formula, frame, groups="whole", re_formula="0", vc_formula=parts)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # also of a variance that is 0, which is an answer
        fit = model.fit(reml=True, method="lbfgs")
    if not fit.converged:
        raise TooLittleError("the fit does not converge: the jumps say too little of athletes and days; measure more")
    return fit


def _athletes(fit: Any, athlete: Any) -> list[Effect]:
    predicted, covariance = fit.random_effects[1], fit.random_effects_cov[1]
    sigmas = dict(zip(predicted.index, np.sqrt(np.diagonal(np.asarray(covariance))).tolist(), strict=True))
    found = []
    for name in sorted(set(athlete)):
        key = f"athlete[C(athlete)[{name}]]"
        found.append(Effect(name, int(np.count_nonzero(athlete == name)), float(predicted[key]), float(sigmas[key])))
    return sorted(found, key=lambda effect: -effect.value)
