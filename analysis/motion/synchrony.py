"""The cameras' synchrony, proved by the moving jumper: whether one camera shows him later than the others.

In the bundle every camera has its own lateness, as an unknown; only their mean is fixed. Cameras that agree within
their sigmas are synchronous: the greatest consistent set is the reference, and each camera is compared with it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri, ndtri

from analysis.result.model import CameraOffset
from rig.arrays import Flags, Floats
from rig.phrase import Phrase, phrase

#: Probability that cameras without fault give any alarm.
FALSE_ALARM_P: Final = 0.002
#: What is less than this is no fault of a trigger: 3 mm of the jumper's way, much less than exposures differ by.
_LEAST_S: Final = 1e-4
_MS = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class Synchrony:
    """The judgement.

    Attributes:
        offsets: by camera.
        late: (m,) which cameras are not synchronous.
        lateness: (m,) relative to the reference, s; to the mean of all where no two cameras agree.
        sigma: (m,) standard deviation of it, s.
        told: whether cameras agree, so that the others are known to be the late ones. Of two that differ nobody knows
            which it is: then the sigma is that of a mean instant that is as far off as they are apart.
    """

    offsets: dict[str, CameraOffset]
    late: Flags
    lateness: Floats
    sigma: Floats
    told: bool


def judged(
    names: tuple[str, ...], took_part: Flags, lateness: Floats, covariance: Floats, interval: float
) -> Synchrony:
    """Judge the lateness (m,) of the cameras, s.

    Args:
        names: of the cameras.
        took_part: (m,) whose measurements were used; of the others nothing is said.
        lateness: from the bundle, up to a common constant.
        covariance: (m, m) of them.
        interval: between two pulses, s.
    """
    m = len(names)
    able = np.flatnonzero(took_part).tolist()
    reference = _reference(able, lateness, covariance)
    limit = -float(ndtri(FALSE_ALARM_P / (2 * m)))
    offsets: dict[str, CameraOffset] = {}
    late, relative, sigmas = np.zeros(m, bool), np.zeros(m), np.zeros(m)
    for i in able if len(able) > 1 else []:
        name = names[i]
        others = [k for k in reference if k != i] or [k for k in able if k != i]
        contrast = np.zeros(m)
        contrast[i] = 1.0
        contrast[others] = -_weights(covariance, others)
        value, sigma = float(contrast @ lateness), float(np.sqrt(contrast @ covariance @ contrast))
        relative[i], sigmas[i] = value, sigma
        late[i] = i not in reference and abs(value) > max(limit * sigma, _LEAST_S)
        said = _said(name, [names[k] for k in others], value, interval) if late[i] else None
        offsets[name] = CameraOffset(value * _MS, sigma * _MS, said)
    told = len(reference) > 1 or not late.any()
    if not told:
        late[able] = True
        relative[reference] = 0.0
        relative[able] -= relative[able].mean()
        sigmas[able] = np.linalg.norm(relative)
    return Synchrony(offsets, late, relative, sigmas, told)


def _reference(able: list[int], lateness: Floats, covariance: Floats) -> list[int]:
    """The cameras that agree: the camera with the largest contradiction is left out, then the next."""
    chosen = able
    while len(chosen) > 1 and _contradiction(lateness, covariance, chosen) > chdtri(len(chosen) - 1, FALSE_ALARM_P):
        if len(chosen) == 2:
            return chosen[:1]
        rest = [[k for k in chosen if k != i] for i in chosen]
        chosen = min(rest, key=lambda left: _contradiction(lateness, covariance, left))
    return chosen


def _contradiction(lateness: Floats, covariance: Floats, chosen: list[int]) -> float:
    """Square sum of the chosen cameras' differences, by their covariance."""
    differences = np.eye(len(chosen))[1:] - np.eye(len(chosen))[0]
    value = differences @ lateness[chosen]
    return float(value @ np.linalg.solve(differences @ covariance[np.ix_(chosen, chosen)] @ differences.T, value))


def _weights(covariance: Floats, chosen: list[int]) -> Floats:
    """Weights of the best mean of some cameras; their sum is 1. What is common to all cameras cancels."""
    own = covariance[np.ix_(chosen, chosen)]
    apart = own - own.mean(axis=0) - own.mean(axis=1)[:, None] + own.mean()
    contrast = np.linalg.pinv(apart + np.full_like(own, np.diagonal(own).max()))
    weights = contrast.sum(axis=0)
    return np.asarray(weights / weights.sum())


def _said(name: str, others: list[str], seconds: float, interval: float) -> Phrase:
    ms, frames = abs(seconds) * _MS, abs(seconds) / interval
    which = phrase("offset_later", "later") if seconds > 0 else phrase("offset_earlier", "earlier")
    if len(others) > 1:
        text = (
            "camera {camera} shows the jumper {ms:.1f} ms ({frames:.2f} frames) {which} than the others: check its "
            "trigger"
        )
        return phrase("offset_of_one", text, camera=name, ms=ms, frames=frames, which=which)
    text = (
        "camera {camera} shows the jumper {ms:.1f} ms ({frames:.2f} frames) {which} than camera {other}: check the "
        "triggers of both"
    )
    return phrase("offset_of_two", text, camera=name, ms=ms, frames=frames, which=which, other=others[0])
