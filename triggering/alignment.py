"""Finds by how much the clocks of two computers differ that recorded the same pulses, from the times of the pulses.

Pulses that come evenly fit at every whole number of periods. What decides between such offsets is how well both clocks
know UTC, the irregularity of the pulses, and time in which one log was recording and had no pulse while the other had
some. What these do not decide is refused: pulses that are joined wrongly would be wrong for ever.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from rig.errors import BadInputError

Times = NDArray[np.float64]

#: Pulses are the same if their times agree to this share of the time between two pulses.
_AGREE_SHARE: Final = 0.25
#: Two computers' clocks differ in rate by less than this (crystals: 50 ppm each; NTP slews by 500 ppm at most, rarely).
_RATE_MAX: Final = 3e-4
#: The ratio of both rhythms is used where it is known to this.
_RATE_KNOWN: Final = 2e-5
#: All cameras of one computer fail to tell of a pulse that others saw with this probability at most.
_UNSEEN: Final = 0.01
#: A rival offset is excluded if it explains the logs worse by this logarithm of probabilities: one in a million, or
#: three pulses that one computer must have seen and has not.
_CERTAIN: Final = -3 * math.log(_UNSEEN)
#: The median of absolute values needs about so many times the samples of a mean, and differences have one in common.
_SAMPLES: Final = 4
_NEVER: Final = 1e-300
#: Deviations of a normal distribution: standard deviation over median of the absolute values.
_MAD: Final = 1.4826
#: Differences of times that are looked at to find offsets, about.
_PAIRS: Final = 4_000_000
_ANCHORS: Final = 256
#: Offsets at which fewer pulses are the same than this share of the most are no rivals: they join the logs at an end.
_VOTES_SHARE: Final = 0.5
_PULSES_LEAST: Final = 3
#: Trying an offset takes some milliseconds.
_OFFSETS_MOST: Final = 20_000
#: The offset is followed along the recording in steps of so many pulses.
_STEP: Final = 64
#: Beyond so many standard deviations the times of a pulse are no longer of the same one; never below the clocks' error.
_OUTLIER: Final = 8.0
_CLOCKS_NS: Final = 500_000.0


@dataclass(frozen=True, slots=True)
class Train:
    """The pulses of one log.

    Attributes:
        times: of its pulses, UTC as its computer knew it, ns, shape (pulses,), rising.
        seen: which of them a camera delivered a frame of, shape (pulses,); the times of others are computed.
        begin, end: between them the log tells of every pulse, ns.
        error_ns: by how much its UTC is wrong at most; None: nobody knows.
    """

    times: NDArray[np.int64]
    seen: NDArray[np.bool_]
    begin: int
    end: int
    error_ns: float | None


@dataclass(frozen=True, slots=True)
class Alignment:
    """Two logs on one line of time, that of the first.

    Attributes:
        pairs: index of each pulse in the first and in the second log, -1 where that has none, shape (pulses, 2), in
            the order of time.
        offset_ns: what is added to the second log's times in the middle of the pulses that both have.
        sigma_ns: its standard deviation.
        drift_ppm: by how much the second computer's clock runs slower.
        residual_ns: standard deviation of the times of the same pulse.
        common: pulses that both logs have.
        shift_at, shift: the offset along the recording: times of the second log, and what is added there, ns.
    """

    pairs: NDArray[np.int64]
    offset_ns: float
    sigma_ns: float
    drift_ppm: float
    residual_ns: float
    common: int
    shift_at: Times
    shift: Times

    def mapped(self, time: int) -> int:
        """A time of the second log on the line of the first."""
        at, shift = self.shift_at, self.shift
        rate = self.drift_ppm * 1e-6
        beyond = min(0.0, time - at[0]) + max(0.0, time - at[-1])
        return time + round(float(np.interp(time, at, shift)) + float(beyond) * rate)


@dataclass(frozen=True, slots=True)
class _Fit:
    """A tried offset, and the evidence against it.

    Attributes:
        offset, rate: what is added to the second log's times: `offset + rate * time`, ns since its first pulse.
        first, second: indexes of the pulses that it makes the same.
        residuals: time in the first log minus that in the second, ns.
        contradictions: pulses that the other log must have seen and has not.
        scatter: standard deviation of the steps of the residuals from pulse to pulse, ns.
        samples: how many steps there are.
    """

    offset: float
    rate: float
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    residuals: Times
    contradictions: int
    scatter: float
    samples: int


def align(first: Train, second: Train) -> Alignment:
    """Find which pulses of two logs are the same.

    Raises:
        BadInputError: there is no such offset, or there are several and nothing decides; the message says what would.
    """
    return _Aligning(first, second).result()


class _Aligning:
    """The two trains on small numbers: ns since the first pulse of each."""

    def __init__(self, first: Train, second: Train) -> None:
        if min(len(first.times), len(second.times)) < _PULSES_LEAST:
            raise BadInputError(
                f"a log has fewer than {_PULSES_LEAST} pulses: too few to find the same ones in the other"
            )
        self._one, self._two = first, second
        self._zero = int(first.times[0]), int(second.times[0])
        self._a: Times = (first.times - self._zero[0]).astype(float)
        self._b: Times = (second.times - self._zero[1]).astype(float)
        self._apart = float(self._zero[0] - self._zero[1])  # offset between the small numbers: UTC agrees at -apart
        intervals = np.concatenate([np.diff(self._a), np.diff(self._b)])
        self._near = _AGREE_SHARE * float(np.percentile(intervals, 1))
        self._rate = _rate_between(self._a, self._b)
        errors = first.error_ns, second.error_ns
        self._window = None if None in errors else float(sum(error or 0.0 for error in errors)) + self._near

    def result(self) -> Alignment:
        fits = [fit for offset in self._offsets() if (fit := self._fit(offset)) is not None]
        if not fits:
            raise BadInputError(f"their pulses fit at no offset{self._within()}: name two logs of the same pulses")
        best = self._best(fits)
        rivals = [
            fit
            for fit in fits
            if abs(fit.offset - best.offset) > 2 * self._near
            and len(fit.first) >= _VOTES_SHARE * len(best.first)
            and _evidence(best, fit) < _CERTAIN
        ]
        if rivals:
            rival = min(rivals, key=lambda fit: abs(fit.offset - best.offset))
            raise BadInputError(
                f"their pulses fit at more than one offset, {self._ms(best):.1f} ms and {self._ms(rival):.1f} ms are "
                f"two of them{self._within()}: keep the clocks of both computers right by NTP or PTP, or let the "
                "pulses pause twice, for a second, while both record"
            )
        return self._aligned(best)

    def _best(self, fits: list[_Fit]) -> _Fit:
        """The best offset that explains both logs.

        Raises:
            BadInputError: none does: at each, too many pulses are in one log only.
        """
        sound = [fit for fit in fits if fit.contradictions <= _most_unseen(len(fit.first))]
        if not sound:
            best = max(fits, key=lambda fit: len(fit.first))
            raise BadInputError(
                f"at the best offset{self._within()}, {self._ms(best):.1f} ms, {len(best.first)} pulses are the same, "
                f"and {best.contradictions} of one log are not in the other, which was recording: these are not the "
                "same pulses, or a clock was set meanwhile; name two logs of the same pulses"
            )
        most = max(len(fit.first) for fit in sound)
        return min(
            (fit for fit in sound if len(fit.first) >= _VOTES_SHARE * most), key=lambda fit: _cost(fit, self._near)
        )

    def _offsets(self) -> Iterator[float]:
        """Offsets at which several pulses could be the same."""
        count = max(16, min(_ANCHORS, _PAIRS // len(self._a)))
        anchors = self._b[np.unique(np.linspace(0, len(self._b) - 1, count).round().astype(int))]
        apart = self._a[None, :] - anchors[:, None]
        allowed = np.full(apart.shape, True) if self._window is None else np.abs(apart + self._apart) <= self._window
        apart = (apart - self._rate * anchors[:, None])[allowed]
        if not len(apart):
            return
        width = self._near / 2
        places, votes = np.unique(np.floor(apart / width).astype(np.int64), return_counts=True)
        joined = np.diff(places) == 1
        before, after = np.append(0, votes[:-1] * joined), np.append(votes[1:] * joined, 0)
        enough = (votes >= _VOTES_SHARE / 2 * votes.max()) & (votes > before) & (votes >= after)
        if np.sum(enough) > _OFFSETS_MOST:
            raise BadInputError(
                f"their pulses could be the same at more than {_OFFSETS_MOST} offsets{self._within()}: keep the "
                "clocks of both computers right by NTP or PTP"
            )
        apart.sort()
        for place in places[enough]:
            # the middle of what lies in neighbouring bins, so that none is cut in two
            inside = apart[slice(*np.searchsorted(apart, ((place - 1) * width, (place + 2) * width)))]
            yield float(np.median(inside))

    def _fit(self, offset: float) -> _Fit | None:
        """Follow an offset along both logs; None if too few pulses fit."""
        rate = self._rate
        first, second, residuals = self._matched(offset, rate)
        for _ in range(2):
            if len(first) < _PULSES_LEAST:
                return None
            shift, more = _line(self._b[second], residuals)
            offset, rate = offset + shift, rate + more
            if abs(rate) > _RATE_MAX:
                return None
            if abs(shift) + abs(more) * self._b[-1] < self._near / 10:
                residuals = residuals - shift - more * self._b[second]  # the same pulses are near enough
                break
            first, second, residuals = self._matched(offset, rate)
        if len(first) < _PULSES_LEAST or not self._is_allowed(offset, rate):
            return None
        measured = self._one.seen[first] & self._two.seen[second]
        steps = np.diff(residuals[measured])
        scatter = _MAD * float(np.median(np.abs(steps))) / math.sqrt(2) if len(steps) else self._near
        contradictions = self._unseen(offset, rate, first, second)
        return _Fit(offset, rate, first, second, residuals, contradictions, max(scatter, 1.0), len(steps))

    def _is_allowed(self, offset: float, rate: float) -> bool:
        """Whether both computers' UTC can be so far apart, in the middle of the second log."""
        middle = float(self._b[-1]) / 2
        return self._window is None or abs(offset + rate * middle + self._apart) <= self._window

    def _matched(self, offset: float, rate: float) -> tuple[NDArray[np.int64], NDArray[np.int64], Times]:
        """Pulses that are nearest to each other, and near enough: their indexes, and by how much they differ."""
        moved = self._b * (1 + rate) + offset
        to_first = _nearest(self._a, moved)
        apart = self._a[to_first] - moved
        mutual = _nearest(moved, self._a)[to_first] == np.arange(len(moved))
        second = np.flatnonzero(mutual & (np.abs(apart) <= self._near))
        return to_first[second], second, apart[second]

    def _unseen(self, offset: float, rate: float, first: NDArray[np.int64], second: NDArray[np.int64]) -> int:
        """How many pulses that one log saw the other must have seen too, because it was recording, and has not."""
        begin, end = ((at - self._zero[1]) * (1 + rate) + offset for at in (self._two.begin, self._two.end))
        moved = self._b * (1 + rate) + offset
        limits = [at - self._zero[0] for at in (self._one.begin, self._one.end)]
        count = 0
        for times, seen, matched, bounds in (
            (self._a, self._one.seen, first, (begin, end)),
            (moved, self._two.seen, second, limits),
        ):
            alone = seen.copy()
            alone[matched] = False
            count += int(np.sum(alone & (times > bounds[0] + self._near) & (times < bounds[1] - self._near)))
        return count

    def _aligned(self, best: _Fit) -> Alignment:
        """The result: the offset followed along the recording, pulses that are not the same taken out again."""
        at, shift = _followed(self._b[best.second], best.residuals)
        rest = best.residuals - np.interp(self._b[best.second], at, shift)
        sigma = _MAD * float(np.median(np.abs(rest)))
        kept = np.abs(rest) <= max(_OUTLIER * sigma, min(_CLOCKS_NS, self._near))
        first, second = best.first[kept], best.second[kept]
        whole = best.offset + self._apart  # on the clocks' own numbers
        line = Alignment(
            np.empty((0, 2), np.int64),
            offset_ns=float(np.median(shift + best.rate * at)) + whole,
            sigma_ns=max(sigma, 1.0) * math.sqrt(_SAMPLES / max(_SAMPLES, len(first))),
            drift_ppm=best.rate * 1e6,
            residual_ns=sigma,
            common=len(first),
            shift_at=at + self._zero[1],
            shift=shift + best.rate * at + whole,
        )
        return Alignment(
            _in_order(self._one.times, np.array([line.mapped(int(time)) for time in self._two.times]), first, second),
            line.offset_ns, line.sigma_ns, line.drift_ppm, line.residual_ns, line.common, line.shift_at, line.shift,
        )  # fmt: skip

    def _ms(self, fit: _Fit) -> float:
        return (fit.offset + self._apart) / 1e6

    def _within(self) -> str:
        """What UTC says, in words."""
        if self._window is None:
            return " (the clock of one computer is not known to be synchronized)"
        return f" within the {(self._window - self._near) / 1e6:.3g} ms to which both clocks were known"


def _rate_between(first: Times, second: Times) -> float:
    """By how much the first clock runs faster, from the rhythm of the pulses; 0 where that does not tell."""
    means, errors = [], []
    for times in (first, second):
        intervals = np.diff(times)
        middle = float(np.median(intervals))
        even = intervals[np.abs(intervals - middle) < 0.05 * middle]
        if 2 * len(even) < len(intervals) or len(even) < _PULSES_LEAST:
            return 0.0
        means.append(float(np.mean(even)))
        errors.append(float(np.std(even)) / math.sqrt(len(even)) / middle)
    rate = means[0] / means[1] - 1
    return rate if math.hypot(*errors) < _RATE_KNOWN and abs(rate) < _RATE_MAX else 0.0


def _nearest(times: Times, wanted: Times) -> NDArray[np.int64]:
    """Index of the nearest of some rising times to each of some others."""
    after = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    return np.asarray(np.where(wanted - times[after - 1] <= times[after] - wanted, after - 1, after), np.int64)


def _line(times: Times, residuals: Times) -> tuple[float, float]:
    """A straight line through residuals, without those far off: value at time 0, and slope."""
    middle = float(np.median(residuals))
    near = np.abs(residuals - middle) <= 3 * _MAD * max(1.0, float(np.median(np.abs(residuals - middle))))
    if np.sum(near) < 2 * _PULSES_LEAST:
        return middle, 0.0
    slope, value = np.polyfit(times[near], residuals[near], 1)
    return float(value), float(slope)


def _followed(times: Times, residuals: Times) -> tuple[Times, Times]:
    """Medians of the residuals along the recording, and where; they follow a clock whose rate changes."""
    pieces = np.array_split(np.arange(len(times)), max(1, len(times) // _STEP))
    at = np.array([np.mean(times[piece]) for piece in pieces])
    return at, np.array([np.median(residuals[piece]) for piece in pieces])


def _most_unseen(common: int) -> float:
    """The most pulses that may be in one log only, by chance, beside so many in both."""
    expected = 2 * _UNSEEN * common
    return expected + 5 * math.sqrt(expected) + _PULSES_LEAST


def _cost(fit: _Fit, near: float) -> float:
    """How badly an offset explains the logs, as a negative logarithm of its probability up to a constant.

    The scatter weighs as the likelihood of as many normal errors; times that agree by chance scatter over `near`, ns.
    """
    return -math.log(_UNSEEN) * fit.contradictions + fit.samples / _SAMPLES * math.log(fit.scatter / near)


def _evidence(best: _Fit, rival: _Fit) -> float:
    """How much better the best offset explains the logs than a rival, as a logarithm of probabilities."""
    free = max(1.0, min(best.samples, rival.samples) / _SAMPLES)
    ratio = (rival.scatter / best.scatter) ** 2
    # The F distribution's probability of a larger ratio, twice: 1 if they are equal.
    chance = 2 * float(betainc(free / 2, free / 2, 1 / (1 + max(ratio, 1 / ratio))))
    by_scatter = -math.log(max(chance, _NEVER))
    unseen = -math.log(_UNSEEN) * (rival.contradictions - best.contradictions)
    return unseen + (by_scatter if ratio >= 1 else -by_scatter)


def _in_order(
    first: NDArray[np.int64], second: NDArray[np.int64], same_first: NDArray[np.int64], same_second: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The pulses of both logs in the order of time, as pairs of indexes; -1 where a log has none."""
    partner = np.full(len(first), -1, np.int64)
    partner[same_first] = same_second
    alone = np.setdiff1d(np.arange(len(second)), same_second)
    pairs = np.concatenate(
        [np.column_stack([np.arange(len(first)), partner]), np.column_stack([np.full(len(alone), -1), alone])]
    )
    order = np.argsort(np.concatenate([first, second[alone]]), kind="stable")
    return np.asarray(pairs[order], np.int64)
