"""Which places in several images are one thing: the explanation with the most images that chi-squared allows."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.digitizing.following.points.candidates import Candidate
from analysis.digitizing.following.points.motion import Belief, Motion
from rig.arrays import Floats
from rig.phrase import NOTHING, Phrase, phrase

GATE_P: Final = 1e-4  #: probability of a true thing to be refused
_MAJORITY = 3  # images that must agree to overrule one: of two that contradict each other either may be wrong
_DOUBT = 2 * float(np.log(1e3))  # by which another explanation must be less likely: a thousand times
_SAME_PX = 1.0  # explanations whose places are all nearer than this are one


def agreeing(
    motion: Motion, belief: Belief, candidates: Mapping[str, Sequence[Candidate]]
) -> tuple[Belief | None, dict[str, Candidate], Phrase]:
    """The candidates that agree with each other and with the predicted motion.

    Args:
        motion: of the thing.
        belief: as predicted.
        candidates: by camera, one at least for each.

    Returns:
        The belief with them; those that agree, none if there are none; and what contradicts. None instead of
        the belief if two explanations are about as likely.
    """
    contradiction = NOTHING
    for count in range(len(candidates), 0, -1):
        if count < len(candidates) and count < _MAJORITY:
            break
        found: list[tuple[float, Belief, dict[str, Candidate]]] = []
        limit, least = float(chdtri(2 * count, GATE_P)), np.inf
        for names in combinations(candidates, count):
            for chosen in product(*(candidates[name] for name in names)):
                explanation = dict(zip(names, chosen, strict=True))
                after, square = motion.updated(belief, {k: each.observation for k, each in explanation.items()})
                least = min(least, square)
                if square <= limit:
                    found.append((square + sum(each.score for each in chosen), after, explanation))
        if found:
            found.sort(key=lambda each: each[0])
            likelihood, after, explanation = found[0]
            for other, _, rival in found[1:]:
                if other - likelihood < _DOUBT and _apart(explanation, rival) > _SAME_PX:
                    return (
                        None,
                        {},
                        phrase("hand_alike", "{cameras} show two places that look alike", cameras=_listed(rival)),
                    )
            return after, explanation, contradiction
        if contradiction is NOTHING:
            contradiction = phrase(
                "hand_contradict",
                "{cameras} contradict each other or the motion (chi-squared {square:.0f}, limit {limit:.0f})",
                cameras=_listed(candidates),
                square=least,
                limit=limit,
            )
    return belief, {}, contradiction


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def _apart(one: Mapping[str, Candidate], other: Mapping[str, Candidate]) -> float:
    """How far two explanations differ in an image, px."""
    offs: list[Floats] = [one[k].observation.xy - other[k].observation.xy for k in one if k in other]
    return max((float(np.hypot(*off)) for off in offs), default=0.0)
