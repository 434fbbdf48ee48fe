"""Watches the balls while frames come: whether a camera moves, as in a whole recording, but from what has come.

A few successive frames make a block; some blocks before and after a move tell it. Every look at the blocks is another
test, and all of them share the risk of a false alarm.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from analysis.cameras.ball_tracker import FrameTurn
from analysis.cameras.frames import Frames
from analysis.cameras.oriented_scene import OrientedScene
from analysis.cameras.pose_change import changed
from analysis.cameras.steadiness import moves_during, trackers_of
from analysis.result.model import CameraMove
from rig.pulse import PulseNumber

_BLOCK: Final = 4  #: frames
_BLOCKS: Final = 16  #: that are looked at together, the latest ones


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

    def look(self, pulse: PulseNumber, frames: Frames) -> bool:
        """Measure the balls in the frames of a pulse.

        Returns:
            Whether the block is full: the next frames are best taken some time later.
        """
        if not self._blocks or len(self._blocks[-1]) == _BLOCK:
            self._blocks.append([])
        block = self._blocks[-1]
        block.append(pulse)
        for name, tracker in self._trackers.items():
            turn = tracker.measure(frames[name]) if name in frames else None
            if turn is not None:
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
            found += moves_during(self._static, tracker, name, turns, self._blocks, tests)[:1]
        return found
