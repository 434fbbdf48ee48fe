"""How well several operators agree who measured the same log: scatter of one click, bias of each, effect on angles."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import is_line
from rig.api.digitizing import FigureAgreement, MarkSource, MarkState, PointAgreement, Repeatability
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import phrase

#: Fewer common points or figures say nothing of a scatter.
_COMMON_LEAST: Final = 3
_BY_HAND: Final = frozenset({MarkSource.HAND, MarkSource.REFINED})

#: Figures by pulse.
Figures = Mapping[int, Mapping[str, float]]


def repeatability(marks: Mapping[str, Iterable[tuple[Key, Entered]]], figures: Mapping[str, Figures]) -> Repeatability:
    """Compare operators.

    Vertices of a line lie anywhere along it: lines are compared by the figures that follow from them.

    Args:
        marks: by operator, two at least.
        figures: by operator, what follows from his marks alone.

    Raises:
        BadInputError: there is one operator, or they have measured too little in common.
    """
    operators = list(marks)
    if len(operators) < 2:
        raise BadInputError(phrase("hand_two_operators", "name two operators or more to compare"))
    places = {operator: dict(_points(of)) for operator, of in marks.items()}
    common = sorted(set.intersection(*(set(of) for of in places.values())))
    things = {}
    for thing in dict.fromkeys(key.thing for key in common):
        keys = [key for key in common if key.thing == thing]
        if len(keys) >= _COMMON_LEAST:
            xy = np.array([[places[operator][key] for key in keys] for operator in operators])
            sigma, bias = _agreement(xy)
            pairs = {o: (float(b[0]), float(b[1])) for o, b in zip(operators, bias, strict=True)}
            things[thing] = PointAgreement(count=len(keys), sigma_px=sigma, bias_px=pairs)
    agreeing = _figures(operators, figures)
    if not things and not agreeing:
        raise BadInputError(
            phrase(
                "hand_little_common",
                "{operators} have measured fewer than {fewest} points in common: measure the same pulses",
                operators=", ".join(operators),
                fewest=_COMMON_LEAST,
            )
        )
    worst = max(things, key=lambda thing: things[thing].sigma_px, default=None)
    said = []
    if worst:
        px = things[worst].sigma_px
        said.append(phrase("hand_scatter", "one click scatters by {px:.2f} px at most ({thing})", px=px, thing=worst))
    for name, agreement in agreeing.items():
        said.append(phrase("hand_figure_scatter", "{figure} by {sigma:.2f}", figure=name, sigma=agreement.sigma))
    return Repeatability(operators=operators, things=things, figures=agreeing, said=tuple(said))


def _points(marks: Iterable[tuple[Key, Entered]]) -> Iterable[tuple[Key, tuple[float, float]]]:
    for key, entered in marks:
        measured = entered.state is MarkState.MEASURED and entered.source in _BY_HAND
        if measured and entered.xy is not None and not is_line(key.thing):
            yield key, entered.xy


def _figures(operators: Sequence[str], figures: Mapping[str, Figures]) -> dict[str, FigureAgreement]:
    pulses = sorted(set.intersection(*(set(figures[operator]) for operator in operators)))
    names = dict.fromkeys(name for operator in operators for pulse in pulses for name in figures[operator][pulse])
    found = {}
    for name in names:
        both = [pulse for pulse in pulses if all(name in figures[operator][pulse] for operator in operators)]
        if len(both) >= _COMMON_LEAST:
            values = np.array([[[figures[operator][pulse][name]] for pulse in both] for operator in operators])
            sigma, bias = _agreement(values)
            by_operator = {o: float(b[0]) for o, b in zip(operators, bias, strict=True)}
            found[name] = FigureAgreement(count=len(both), sigma=sigma, bias=by_operator)
    return found


def _agreement(values: Floats) -> tuple[float, Floats]:
    """Scatter of one value, and means (operators, components) beside that of all, of (operators, n, components).

    The scatter is that of the residuals of a two-way layout: operator and item each have a mean.
    """
    operators, count, components = values.shape
    off = values - values.mean(axis=0)
    bias = off.mean(axis=1)
    freedom = (operators - 1) * (count - 1) * components
    return float(np.sqrt(((off - bias[:, None]) ** 2).sum() / freedom)), bias
