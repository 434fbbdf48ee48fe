"""Watches the balls while frames come: whether a camera moves, as in a whole recording, but from what has come.

A few successive frames make a block; some blocks before and after a move tell it. Every look at the blocks is another
test, and all of them share the risk of a false alarm.

The same looks tell which cameras shake: those whose frames differ from the static image by more than their noise. How
such a camera stood is measured in every frame, so that the shake can be taken out of what the frame shows.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.cameras.ball_tracker import FrameTurn
from analysis.cameras.frames import Frames
from analysis.cameras.oriented_scene import OrientedScene
from analysis.cameras.pose_change import changed
from analysis.cameras.standing import FrameShake
from analysis.cameras.steadiness import SHAKE_RISK, moves_between, moves_during, trackers_of
from analysis.result.model import CameraMove
from rig.pulse import PulseNumber

_BLOCK: Final = 4  #: frames
_BLOCKS: Final = 16  #: that are looked at together, the latest ones
_FRAMES_LEAST: Final = 3  #: frames that tell whether a camera shakes


class LiveWatch:
    """The balls of all cameras, from the static images of a scene on.

    Args:
        scene: the cameras and balls.
    """

    def __init__(self, scene: OrientedScene) -> None:
        self._static = changed(scene.system, scene.changes)
        self._trackers = trackers_of(scene)
        self._blocks: deque[list[PulseNumber]] = deque(maxlen=_BLOCKS)
        self._turns: dict[str, dict[PulseNumber, FrameTurn]] = {name: {} for name in self._trackers}
        self._looks = 0
        self._latest: dict[str, deque[FrameTurn]] = {name: deque(maxlen=_BLOCKS * _BLOCK) for name in self._trackers}

    def begin(self, frames: Iterable[Frames]) -> None:
        """Measure the balls in some frames of the time of the static images, so that cameras that shake are known."""
        for of_pulse in frames:
            self._measure(of_pulse, self._trackers)

    def stood(self, frames: Frames) -> Mapping[str, FrameShake]:
        """How the cameras that shake stood in the frames of a pulse, against their static images.

        Where its balls cannot be measured a camera stood anywhere in its shake.
        """
        shaking = [name for name, latest in self._latest.items() if name in frames and _shakes(latest)]
        turns = self._measure(frames, shaking)
        stood = {}
        for name in shaking:
            turn = turns.get(name)
            off = np.array([latest.turn for latest in self._latest[name]])
            unknown = FrameShake(np.zeros(3), off.T @ off / len(off))
            stood[name] = unknown if turn is None else FrameShake(turn.turn, turn.covariance)
        return stood

    def _measure(self, frames: Frames, names: Iterable[str]) -> dict[str, FrameTurn]:
        """How some cameras stood in the frames of a pulse; those that could not be measured are left out."""
        measured = {name: self._trackers[name].measure(frames[name]) for name in names if name in frames}
        turns = {name: turn for name, turn in measured.items() if turn is not None}
        for name, turn in turns.items():
            self._latest[name].append(turn)
        return turns

    def look(self, pulse: PulseNumber, frames: Frames) -> bool:
        """Measure the balls in the frames of a pulse.

        Returns:
            Whether the block is full: the next frames are best taken some time later.
        """
        if not self._blocks or len(self._blocks[-1]) == _BLOCK:
            self._blocks.append([])
        block = self._blocks[-1]
        block.append(pulse)
        for name, turn in self._measure(frames, self._trackers).items():
            self._turns[name][pulse] = turn
        return len(block) == _BLOCK

    def moves(self) -> Sequence[CameraMove]:
        """The cameras that have moved, each with its first move."""
        self._looks += 1
        found = []
        for name, tracker in self._trackers.items():
            turns = {pulse: turn for pulse, turn in self._turns[name].items() if pulse >= self._blocks[0][0]}
            self._turns[name] = turns
            tests = len(self._trackers) * self._looks
            found += moves_during(self._static, tracker, name, turns, moves_between(turns, self._blocks, tests))[:1]
        return found


def _shakes(turns: Sequence[FrameTurn]) -> bool:
    """Whether frames differ from the static image by more than the noise of their turns."""
    if len(turns) < _FRAMES_LEAST:
        return False
    off, covariance = np.array([turn.turn for turn in turns]), np.array([turn.covariance for turn in turns])
    squares = float((off * np.linalg.solve(covariance, off[..., None])[..., 0]).sum())
    return bool(squares > chdtri(3 * len(turns), SHAKE_RISK))
