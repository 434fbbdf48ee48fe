"""Whether a camera moved during a recording: knocks and drifts, told from the shake that every mast has.

The turns of single frames are averaged over blocks of some tenths of a second, in which shake averages out mostly.
How much the means of blocks still scatter is estimated from the recording itself, so that wind makes the test more
careful and never makes an alarm. A knock is a step between two blocks, a drift a slope over all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtr

from rig.arrays import Floats
from rig.phrase import Phrase, phrase
from rig.phrases import enumerated

FAMILY_RISK: Final = 3e-4  #: chance that a recording with still cameras is said to have a moved one
_BLOCKS_LEAST = 5  # blocks
_CLEARLY = 3.0  # times less residuals must be left if a block is left out
_SAID = 0.25  # of the largest part of a turn: smaller parts are not worth words
STEADY: Final = 2e-5  #: rad (0.001 deg): smaller changes of the images have other causes than a camera that moves


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Some successive frames of a camera.

    Attributes:
        first: pulse of the first frame.
        last: pulse of the last frame.
        turn: (3,) mean, rad.
        variance: (3,) of the mean, from the measurement alone.
    """

    first: int
    last: int
    turn: Floats
    variance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Move:
    """A movement during the recording.

    Attributes:
        drift: whether it went on through the whole stretch; else it was a knock.
        before: the last pulse before it.
        after: the first pulse after it.
        turn: (3,) rad, about the camera's own axes.
        p: probability of so much in a camera that only shakes, all tests considered.
    """

    drift: bool
    before: int
    after: int
    turn: Floats
    p: float


def find_moves(blocks: Sequence[Block], cameras: int) -> list[Move]:
    """The movements that the blocks of one camera show, in order.

    Args:
        blocks: in order.
        cameras: number of cameras that are tested; all share the risk.
    """
    if len(blocks) < _BLOCKS_LEAST:
        return []
    turns = np.array([block.turn for block in blocks])
    middle = np.array([(block.first + block.last) / 2 for block in blocks])
    known = np.array([block.variance for block in blocks]).mean(axis=0) + STEADY**2
    n = len(blocks)
    place = np.arange(n)
    # knocks between two blocks, then knocks within one, which says nothing then, then the drift
    steps = [(k, k) for k in range(1, n)] + [(k, k + 1) for k in range(1, n - 1)]
    tests = [
        _tested(turns[kept], np.where(place[kept] < end, -0.5, 0.5), known)
        for kept, end in (((place < end) | (place >= begin), end) for end, begin in steps)
    ]
    tests.append(_tested(turns, (middle - middle[0]) / (middle[-1] - middle[0]) - 0.5, known))
    # the alternative that leaves least, all axes together; without a block something always leaves less
    best = min(range(len(tests)), key=lambda i: tests[i].misfit * (_CLEARLY if n - 1 <= i < len(steps) else 1.0))
    p = min(1.0, tests[best].p * 3 * len(tests) * cameras)
    if p > FAMILY_RISK:
        return []
    if best == len(steps):
        return [Move(True, blocks[0].first, blocks[-1].last, tests[best].effect, p)]
    end, begin = steps[best]
    found = Move(False, blocks[end - 1].last, blocks[begin].first, tests[best].effect, p)
    return [*find_moves(blocks[:end], cameras), found, *find_moves(blocks[begin:], cameras)]


@dataclass(frozen=True, slots=True, eq=False)
class _Test:
    """Effect (3,), residuals per degree of freedom in units of the known noise, p of the most significant axis."""

    effect: Floats
    misfit: float
    p: float


def _tested(turns: Floats, design: Floats, known: Floats) -> _Test:
    """One alternative: turns are a constant and `design` times an effect; the smallest p of the three axes."""
    n = len(turns)
    x = design - design.mean()
    effect = x @ turns / (x @ x)
    residual = turns - turns.mean(axis=0) - np.outer(x, effect)
    freedom = n - 2
    variance = np.maximum((residual**2).sum(axis=0) / freedom, known)
    # neighbouring blocks are alike in slow gusts: fewer of them are independent
    alike = np.clip((residual[1:] * residual[:-1]).sum(axis=0) / np.maximum((residual**2).sum(axis=0), 1e-30), 0, 0.8)
    sigma = np.sqrt(variance * (1 + alike) / (1 - alike) / (x @ x))
    p = 2 * stdtr(freedom, -np.abs(effect) / sigma)
    return _Test(effect, float(((residual**2).sum(axis=0) / known).sum()) / freedom, float(p.min()))


def move_said(camera: str, turn: Floats, shift: Floats, move: Move | None) -> Phrase:
    """A move in words.

    Args:
        camera: its name.
        turn: (3,) rad, about the camera's own axes.
        shift: (3,) m; zero if none was found.
        move: when; None: since the calibration.
    """
    size = float(np.degrees(np.linalg.norm(turn)))
    parts = turn_words(turn)
    if len(parts) == 1:
        words = phrase("move_turned", "turned by {turn}", turn=parts[0])
    else:
        text = "turned by {size:.3f} deg ({parts})"
        words = phrase("move_turned_parts", text, size=round(size, 3), parts=enumerated(parts))
    if shift.any():
        metres = round(float(np.linalg.norm(shift)), 3)
        words = phrase("move_shifted", "{turned} and was shifted by {metres:.3f} m", turned=words, metres=metres)
    if move is None:
        return phrase("move_calibration", "camera {camera} {how} since the calibration", camera=camera, how=words)
    if move.drift:
        text = "camera {camera} drifts: it {how} from pulse {before} to {after}"
        return phrase("move_drift", text, camera=camera, how=words, before=move.before, after=move.after)
    text = "camera {camera} {how} between pulse {before} and {after}"
    return phrase("move_between", text, camera=camera, how=words, before=move.before, after=move.after)


#: By axis of the camera: where it turns to if the angle is positive, and if it is negative.
_WAYS: Final = (
    (phrase("way_up", "up"), phrase("way_down", "down")),
    (phrase("way_left", "to the left"), phrase("way_right", "to the right")),
    (phrase("way_counter", "counter-clockwise"), phrase("way_clockwise", "clockwise")),
)


def turn_words(turn: Floats) -> list[Phrase]:
    """The parts of a turn that matter, the largest first: "0.050 deg to the right"."""
    degrees = np.degrees(turn).tolist()  # numbers of Python: numpy's have no form in JSON
    order = sorted(range(3), key=lambda i: -abs(degrees[i]))
    named = [i for i in order if abs(degrees[i]) >= _SAID * abs(degrees[order[0]])]
    text = "{degrees:.3f} deg {way}"
    return [
        phrase("move_part", text, degrees=round(abs(degrees[i]), 3), way=_WAYS[i][int(degrees[i] < 0)]) for i in named
    ]
