"""What the skis of a jumper who is followed look like to each camera, learned from the images measured so far.

Where along a ski its visible ends are, how wide it is and whether it is brighter than what is behind it stays the same
from pulse to pulse; slope, heading and place are predicted. Together they say where the next image shows the ski.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from analysis.candidates.median import median
from analysis.candidates.model import ExpectedSki, Trace
from analysis.candidates.skis.ski_widths import SkiWidth, clear_widths, told_apart
from analysis.identification.space.views import Sight
from analysis.measurements.model import SIDES
from analysis.result.model import PointState, SkiState, SmoothedState
from photogrammetry.jumper.stick_model import by_slope_and_heading
from rig.arrays import Floats

BINDINGS: Final = ("P3", "P4")  #: of the right and the left ski
_HALF_M: Final = 1.0  #: of a ski, from its binding: between such points its image is straight
_LONGEST_M: Final = 1.4  #: from a binding to tail or tip: skis of 2.8 m
_RECENT: Final = 60  #: widths of a camera that count: those of the last second of two skis at 30 Hz


@dataclass(slots=True)
class _Known:
    """What a camera showed of the skis.

    Attributes:
        xy: (2, 2, 2) px, by side, where the present image is expected to show both ends of `_HALF_M`; NaN: unknown.
        scale: px per m there, between the bindings.
        widths: m, of all traces of skis.
        clear: m, of those that the other ski does not hide.
        ends: (2, 2) m from the binding, by side: how far towards tail and tip a ski was seen.
        sign: of the contrast; 0: unknown.
    """

    xy: Floats = field(default_factory=lambda: np.full((2, 2, 2), np.nan))
    scale: float = np.nan
    widths: list[float] = field(default_factory=list)
    clear: list[float] = field(default_factory=list)
    ends: Floats = field(default_factory=lambda: np.full((2, 2), np.nan))
    sign: float = 0.0


class SkiImages:
    """The images of the skis of one jumper; of each pulse, first what is expected, then what was found.

    Args:
        cameras: how many.
    """

    def __init__(self, cameras: int) -> None:
        self._known = [_Known() for _ in range(cameras)]

    def continue_from(self, other: "SkiImages") -> None:
        """Take over what another one has learned of the same jumper, who may have had the sides exchanged."""
        for own, known in zip(self._known, other._known, strict=True):
            if known.widths:
                own.widths, own.clear, own.sign = list(known.widths), list(known.clear), known.sign
                own.ends[:] = np.nanmean(known.ends, axis=0)

    @staticmethod
    def places(state: SmoothedState) -> Floats:
        """Object points (4, 3) that a camera must be asked for to say what it shows: two of each ski, tail first."""
        points = []
        for label, side in zip(BINDINGS, SIDES, strict=True):
            binding, ski = state.points[label], state.skis[side]
            ends = np.array((-_HALF_M, _HALF_M))[:, None]
            points.append(
                np.full((2, 3), np.nan) if binding is None or ski is None else binding.xyz + ends * ski.direction
            )
        return np.concatenate(points)

    def expected(self, k: int, state: SmoothedState, sight: Sight) -> tuple[ExpectedSki, ...]:
        """Where camera k shows both skis; none if nothing is known of them.

        Args:
            k: number of the camera.
            state: predicted.
            sight: how the camera sees `places` of that state.
        """
        known = self._known[k]
        known.xy = sight.xy.reshape(2, 2, 2)
        known.scale = float(np.linalg.norm(np.nan_to_num(sight.by_point.mean(axis=0)), ord=2))
        if not known.widths or not np.isfinite(known.xy).all():
            return ()
        px = median(np.array(known.widths)) * known.scale
        either = np.nanmean(known.ends, axis=0)
        found = []
        for i, (label, side) in enumerate(zip(BINDINGS, SIDES, strict=True)):
            binding, ski, own = state.points[label], state.skis[side], slice(2 * i, 2 * i + 2)
            if binding is None or ski is None:
                return ()
            aside = _aside(sight.by_point[own], known.xy[i], binding, ski)
            middle, half = known.xy[i].mean(axis=0), (known.xy[i, 1] - known.xy[i, 0]) / 2
            ends = np.where(np.isfinite(known.ends[i]), known.ends[i], either)
            found.append(ExpectedSki(middle + ends[:, None] / _HALF_M * half, px, known.sign > 0, aside))
        return tuple(found)

    def told_apart(self, k: int, traces: tuple[Trace, ...]) -> tuple[Trace, ...]:
        """The traces of an image of camera k as those of skis as wide as the images until this one show them."""
        known = self._known[k]
        if not np.isfinite(known.scale):
            return traces
        known.clear = [*known.clear, *(px / known.scale for px in clear_widths(traces))][-_RECENT:]
        width = SkiWidth.of(known.clear) or SkiWidth.of([m for each in self._known for m in each.clear])
        return traces if width is None else told_apart(traces, width.m * known.scale, width.spread)

    def learn(self, k: int, found: Mapping[int, Sequence[Trace]]) -> None:
        """Learn from the traces that show skis in an image of camera k, by number of the side."""
        known = self._known[k]
        for i, parts in found.items():
            axis = known.xy[i, 1] - known.xy[i, 0]
            if not np.isfinite(axis).all():
                continue
            from_tail = np.concatenate([part.ends for part in parts]) - known.xy[i, 0]
            along = _HALF_M * (2 * from_tail @ axis / (axis @ axis) - 1)
            tail, tip = np.clip((along.min(), along.max()), -_LONGEST_M, _LONGEST_M)
            known.ends[i] = np.fmin(known.ends[i, 0], tail), np.fmax(known.ends[i, 1], tip)
            known.sign = float(np.sign(parts[0].contrast))
            known.widths = [*known.widths, *(part.width / known.scale for part in parts)][-_RECENT:]


def _aside(by_point: Floats, xy: Floats, binding: PointState, ski: SkiState) -> float:
    """Standard deviation of a predicted ski across its image, px, at the worse end.

    Args:
        by_point: (2, 2, 3) derivatives of two points of its image by the object point.
        xy: (2, 2) these points, px.
        binding: predicted.
        ski: predicted.
    """
    turns = by_slope_and_heading(ski.direction[None])[0]
    spread = binding.covariance + _LONGEST_M**2 * turns @ ski.covariance @ turns.T
    axis = xy[1] - xy[0]
    across = np.array((-axis[1], axis[0])) / np.hypot(*axis) @ by_point
    return float(np.sqrt(((across @ spread) * across).sum(axis=1).max()))
