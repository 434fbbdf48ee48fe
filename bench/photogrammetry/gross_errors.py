"""Benchmark of the search for gross errors: what happens to hills that are spoilt in known ways."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from bench.photogrammetry.hills import KINDS, Hill, hill, with_poses
from photogrammetry.adjustment.gross_errors.blunders import Blunder, Observation, observation_to_json
from photogrammetry.adjustment.run import Outcome
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.model import Network
from photogrammetry.procedures.orientation import orient

#: A result is wrong if a projection centre is off by more than so many of its standard deviations.
WRONG_SIGMAS: Final = 5.0

Adjusting = Callable[[Network], Outcome]


@dataclass(frozen=True, slots=True)
class Fate:
    """What became of one spoilt hill.

    Attributes:
        removed, named, undetected: of its culprits: taken out, named among others, neither.
        innocents: sound observations that were taken out.
        refused: whether there is no result.
        off: largest error of a projection centre, in sigmas; 0 without a result.
    """

    removed: int
    named: int
    undetected: int
    innocents: int
    refused: bool
    off: float


def fate(case: Hill, adjusting: Adjusting) -> Fate:
    """Search a hill for gross errors and compare with the truth."""
    culprits = set(case.culprits)
    try:
        outcome = adjusting(case.network)
    except (NotSolvableError, NotConvergedError, RefusedError) as error:
        named = {culprit for culprit in culprits if culprit.split()[0] in _words(str(error))}
        return Fate(0, len(named), len(culprits - named), 0, True, 0.0)
    # what cannot be told apart may be taken out together
    together = [{_name(one.network, o) for o in _accused(one.blunder)} for one in (*outcome.removed, *outcome.aside)]
    gone = set().union(*together)
    innocents = sum(not names & culprits for names in together)
    network = outcome.adjustment.network
    told = {_name(network, one) for b in outcome.blunders for one in _accused(b)}
    removed, left = culprits & gone, culprits - gone
    a = outcome.adjustment
    off = np.abs(a.state.position - case.positions) / a.sigmas(a.problem.unknowns.pose[:, :3])
    return Fate(len(removed), len(left & told), len(left - told), innocents, False, float(off.max()))


def _accused(blunder: Blunder) -> tuple[Observation, ...]:
    return blunder.candidates or (blunder.suspect,)


def _words(text: str) -> set[str]:
    return set(text.replace(",", " ").replace(";", " ").replace(":", " ").replace("(", " ").replace(")", " ").split())


def _name(network: Network, observation: Observation) -> str:
    names = observation_to_json(network, observation)
    return names["point"] if names["image"] is None else f"{names['point']} in {names['image']}"


def run_gross_errors(draws: int, kinds: tuple[str, ...] = tuple(KINDS)) -> list[dict[str, Any]]:
    """Draw hills, spoil them in each way, and orient them.

    Args:
        draws: hills of each kind; every second one is without helmets.
        kinds: which ways.

    Returns:
        For each kind the sums over its hills.
    """
    return [_case(kind, draws, lambda network: orient(network).outcome) for kind in kinds]


def _case(kind: str, draws: int, adjusting: Adjusting) -> dict[str, Any]:
    spoil, poses = KINDS[kind]
    fates, culprits = [], 0
    for seed in range(draws):
        rng = np.random.default_rng([seed, list(KINDS).index(kind)])
        case = hill(rng, helmets=seed % 2 == 0)
        case = spoil(with_poses(case, rng) if poses else case, rng)
        culprits += len(case.culprits)
        fates.append(fate(case, adjusting))
    wrong = [seed for seed, one in enumerate(fates) if one.off > WRONG_SIGMAS]
    return {
        "name": kind,
        "networks": draws,
        "culprits": culprits,
        **{key: sum(getattr(one, key) for one in fates) for key in ("removed", "named", "undetected", "innocents")},
        "refused": sum(one.refused for one in fates),
        "wrong": len(wrong),
        "wrong_seeds": wrong,
        "largest_sigmas": round(max(one.off for one in fates), 1),
    }
