"""Whether the cameras of a recording stood still, and how they stood during each jump.

The balls are followed through frames spread over the recording, and through all frames of a jump. Moves since the
calibration and during the recording are named. For a jump the poses are those of its own frames, and the shake of each
frame is taken out of what was measured in it (`analysis.cameras.standing`).
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from analysis.cameras.ball_tracker import BallTracker, FrameTurn
from analysis.cameras.frames import FrameSource
from analysis.cameras.moves import FAMILY_RISK, STEADY, Block, Move, find_moves, move_said
from analysis.cameras.oriented_scene import OrientedScene
from analysis.cameras.pose_change import Displacements, PoseChange, changed, pose_change
from analysis.cameras.standing import FrameShake, Standing
from analysis.result.model import CameraMove
from analysis.scene.camera_system import CameraSystem
from photogrammetry.geometry.rotation import rotation_from_vector, vector_from_rotation
from rig.arrays import Floats
from rig.phrase import Phrase, phrase
from rig.pulse import PulseNumber

_BLOCKS = 16  # in which a recording is looked at
_BLOCK_FRAMES = (4, 10)  # at least and at most
_FEWEST_FRAMES = 3  # of a jump, for its own pose
_CORRECTED_RISK = 0.01  # chance that the pose of a still camera is corrected for a jump, which does no harm
SHAKE_RISK = 1e-3  #: chance that the frames of a still camera are corrected one by one
_MODEL_SIGMA = 0.01  # px, of the mean displacement of a ball: what matching leaves out in all frames alike
_SEEN = 0.3  # share of the frames in which a ball must have been measured

_Turns = Mapping[PulseNumber, FrameTurn]


@dataclass(frozen=True, slots=True, eq=False)
class Steadiness:
    """How the cameras of a recording stood.

    Attributes:
        moved: cameras that moved since the calibration or during the recording, in order of the cameras.
        messages: what else a person should know.
        still: of cameras that were knocked during the recording, the pulses of the longest time without a knock.
    """

    moved: tuple[CameraMove, ...]
    messages: tuple[Phrase, ...]
    still: Mapping[str, range]
    _scene: OrientedScene
    _tracks: "_Tracks"
    _static: CameraSystem

    def during(self, pulses: Collection[int]) -> Standing:
        """The cameras as they stood in some pulses, those of a jump.

        Args:
            pulses: of the jump.
        """
        tracks = self._tracks.during(pulses)
        changes: dict[str, PoseChange] = {}
        shakes: dict[str, dict[PulseNumber, FrameShake]] = {}
        for name, turns in tracks.items():
            change = self._mean_change(name, turns)
            total = _joined(self._scene.changes.get(name), change)
            mean = np.zeros(3)
            if total is not None and total.p() < _CORRECTED_RISK:
                changes[name] = total
                mean = _mean([turn.turn for turn in turns.values()])
            if shake := _shake(turns, mean, [PulseNumber(p) for p in pulses]):
                shakes[name] = shake
        return Standing(changed(self._scene.system, changes), shakes)

    def with_scene(self, scene: OrientedScene) -> "Steadiness":
        """The same after the cameras were oriented anew from the same images, by more points."""
        return replace(self, _scene=scene, _static=changed(scene.system, scene.changes))

    def _mean_change(self, name: str, turns: _Turns) -> PoseChange | None:
        """The change of the pose from the static image to the mean of some frames."""
        if len(turns) < _FEWEST_FRAMES:
            return None
        tracker = self._tracks.trackers[name]
        return pose_change(self._static[name], tracker.displaced(*_mean_off(tracker, list(turns.values()))))


def watch(scene: OrientedScene, source: FrameSource) -> Steadiness:
    """Follow the balls through a recording.

    Args:
        scene: its cameras and balls.
        source: its frames.
    """
    static, trackers = changed(scene.system, scene.changes), trackers_of(scene)
    blocks = _sampled(source.pulses)
    followed = _Tracks(trackers, source)
    tracks = followed.during({pulse for block in blocks for pulse in block})
    moved: list[CameraMove] = []
    messages: list[Phrase] = []
    still: dict[str, range] = {}
    for name, turns in tracks.items():
        moved += _since_calibration(name, scene.changes.get(name), turns, len(blocks), len(tracks))
        found = moves_between(turns, blocks, len(tracks))
        moved += moves_during(static, trackers[name], name, turns, found)
        if any(not move.drift for move in found):
            still[name] = _longest_still(found, source.pulses)
        frames = sum(len(block) for block in blocks)
        if len(turns) < frames / 2:
            text = (
                "camera {camera}: its balls were found in {found} of {frames} frames that were looked at, so whether "
                "it stood still is not known for all of the recording"
            )
            messages.append(phrase("steady_unknown", text, camera=name, found=len(turns), frames=frames))
    return Steadiness(tuple(moved), tuple(messages), still, scene, followed, static)


def trackers_of(scene: OrientedScene) -> dict[str, BallTracker]:
    """Trackers of the balls by camera, from its static image on."""
    static = changed(scene.system, scene.changes)
    trackers = {}
    for name in static.names:
        balls = {ball: known.xyz for ball, known in scene.balls.items() if name in known.images}
        places = {ball: scene.balls[ball].images[name] for ball in balls}
        trackers[name] = BallTracker(static[name], scene.static[name], balls, places)
    return trackers


def standing_in(scene: OrientedScene) -> tuple[OrientedScene, list[CameraMove]]:
    """A scene whose poses are those of its static images, and what has moved since its calibration."""
    changes = {name: change for name, change in scene.changes.items() if change.p() < _CORRECTED_RISK}
    moved = [
        move for name, change in changes.items() for move in _since_calibration(name, change, {}, 0, len(scene.changes))
    ]
    return replace(scene, system=changed(scene.system, changes), changes={}), moved


def _sampled(pulses: Sequence[PulseNumber]) -> list[list[PulseNumber]]:
    """Blocks of successive pulses, spread unevenly over a recording, so that no vibration is in step with them."""
    size = min(max(len(pulses) // _BLOCKS, _BLOCK_FRAMES[0]), _BLOCK_FRAMES[1])
    count = min(_BLOCKS, len(pulses) // size)
    if count < 1:
        return [list(pulses)] if pulses else []
    free = len(pulses) - count * size
    rng = np.random.default_rng(len(pulses))
    gaps = np.floor(np.sort(rng.uniform(0, free + 1, count))).astype(int)
    gaps[0], gaps[-1] = 0, free if count > 1 else 0
    starts = gaps + np.arange(count) * size
    return [list(pulses[start : start + size]) for start in starts]


class _Tracks:
    """How the cameras stood in single pulses; each is measured once.

    Attributes:
        trackers: by camera.
    """

    def __init__(self, trackers: Mapping[str, BallTracker], source: FrameSource) -> None:
        self.trackers, self._source = trackers, source
        self._known: dict[PulseNumber, dict[str, FrameTurn]] = {}

    def during(self, pulses: Collection[int]) -> dict[str, _Turns]:
        """By camera, how it stood in some pulses, in order; without those in which it could not be measured."""
        for pulse, frames in self._source.frames({pulse for pulse in pulses if pulse not in self._known}):
            turns = {name: tracker.measure(frames[name]) for name, tracker in self.trackers.items() if name in frames}
            self._known[pulse] = {name: turn for name, turn in turns.items() if turn is not None}
        seen = [(pulse, self._known[pulse]) for pulse in sorted(self._known) if pulse in pulses]
        return {name: {pulse: turns[name] for pulse, turns in seen if name in turns} for name in self.trackers}


def moves_between(turns: _Turns, pulses: Sequence[Sequence[PulseNumber]], cameras: int) -> list[Move]:
    """The moves of a camera between blocks of frames, in order.

    Args:
        turns: how it stood in single frames.
        pulses: of the blocks.
        cameras: number of cameras that are tested; all share the risk of a false alarm.
    """
    seen = [[turns[pulse] for pulse in block if pulse in turns] for block in pulses]
    blocks = [
        Block(
            int(block[0]),
            int(block[-1]),
            _mean([turn.turn for turn in inside]),
            np.mean([np.diagonal(turn.covariance) for turn in inside], axis=0) / len(inside),
        )
        for block, inside in zip(pulses, seen, strict=True)
        if inside
    ]
    return find_moves(blocks, cameras)


def moves_during(
    static: CameraSystem, tracker: BallTracker, name: str, turns: _Turns, found: Sequence[Move]
) -> list[CameraMove]:
    """The moves of a camera in words and numbers.

    Args:
        static: the cameras as they stand in the static images.
        tracker: of the balls of the camera.
        name: of the camera.
        turns: how it stood in single frames.
        found: its moves, in order.
    """
    moves = []
    for i, move in enumerate(found):
        turn, shift = move.turn, np.zeros(3)
        if not move.drift:
            begin = found[i - 1].after if i else 0
            end = found[i + 1].before if i + 1 < len(found) else np.inf
            one, other = (
                [turns[p] for p in turns if low <= p <= high] for low, high in ((begin, move.before), (move.after, end))
            )
            change = pose_change(static[name], _between(tracker, one, other))
            if change is not None:
                turn, shift = change.turn, change.shift
        moves.append(_camera_move(name, turn, shift, move.p, move))
    return moves


def _longest_still(found: Sequence[Move], pulses: Sequence[PulseNumber]) -> range:
    """The pulses of the longest time between the knocks among the moves of a camera."""
    knocks = [move for move in found if not move.drift]
    begins = [int(pulses[0]), *(move.after for move in knocks)]
    ends = [*(move.before for move in knocks), int(pulses[-1])]
    return max((range(begin, end + 1) for begin, end in zip(begins, ends, strict=True)), key=len)


def _since_calibration(
    name: str, change: PoseChange | None, turns: _Turns, blocks: int, cameras: int
) -> list[CameraMove]:
    """The change of a camera since the calibration, if it is more than noise and shake make."""
    if change is None:
        return []
    more = np.zeros((6, 6))
    more[3:, 3:] = STEADY**2 * np.eye(3)
    if len(turns) > 1:
        more[3:, 3:] += 2 * np.cov([turn.turn for turn in turns.values()], rowvar=False) / max(1, blocks)
    p = min(1.0, change.p(more) * cameras)
    if p > FAMILY_RISK:
        return []
    return [_camera_move(name, change.turn, change.shift, p, None)]


def _camera_move(name: str, turn: Floats, shift: Floats, p: float, move: Move | None) -> CameraMove:
    return CameraMove(name, move_said(name, turn, shift, move), np.degrees(turn), shift, p)


def _mean(turns: Iterable[Floats]) -> Floats:
    return np.asarray(np.mean(list(turns), axis=0), float)


def _mean_off(tracker: BallTracker, turns: Sequence[FrameTurn]) -> tuple[Floats, Floats]:
    """Mean displacements of the balls (n, 2) in some frames and their variances; NaN for those that are seldom seen.

    Each frame's turn is taken out before the mean is formed, so that frames in which a ball is hidden do no harm.
    """
    turn = _mean([t.turn for t in turns])
    off = np.array([t.off - tracker.by_turn @ t.turn for t in turns])
    count = np.isfinite(off).all(axis=2).sum(axis=0)
    enough = count >= max(1, _SEEN * len(turns))
    divisor = np.maximum(count, 1)[:, None]
    mean = tracker.by_turn @ turn + np.nansum(off, axis=0) / divisor
    variance = np.nansum([t.variance for t in turns], axis=0) / divisor**2 + _MODEL_SIGMA**2
    return np.where(enough[:, None], mean, np.nan), variance


def _between(tracker: BallTracker, before: Sequence[FrameTurn], after: Sequence[FrameTurn]) -> Displacements:
    """Displacements of the balls from some frames to others."""
    one, other = (_mean_off(tracker, turns) for turns in (before, after))
    return tracker.displaced(other[0] - one[0], other[1] + one[1])


def _joined(first: PoseChange | None, second: PoseChange | None) -> PoseChange | None:
    """One change after another."""
    if first is None or second is None:
        return first or second
    turn = vector_from_rotation(rotation_from_vector(first.turn) @ rotation_from_vector(second.turn))
    return PoseChange(
        turn,
        first.shift + second.shift,
        first.covariance + second.covariance,
        second.used,
        second.left_out,
        second.factor,
    )


def _shake(turns: _Turns, mean: Floats, pulses: Sequence[PulseNumber]) -> dict[PulseNumber, FrameShake]:
    """The shake of each frame about the mean turn; none if the frames do not scatter more than their noise."""
    if len(turns) < _FEWEST_FRAMES:
        return {}
    off = np.array([turn.turn for turn in turns.values()])
    squares = sum(
        float(d @ np.linalg.solve(turn.covariance, d)) for d, turn in zip(off - _mean(off), turns.values(), strict=True)
    )
    if chdtrc(3 * (len(turns) - 1), squares) > SHAKE_RISK:
        return {}
    back = rotation_from_vector(mean).T
    shake = {
        pulse: FrameShake(vector_from_rotation(back @ rotation_from_vector(turn.turn)), turn.covariance)
        for pulse, turn in turns.items()
    }
    # where the balls were not measured, the camera stood anywhere in its shake
    unknown = FrameShake(_mean(off) - mean, np.cov(off, rowvar=False))
    return {pulse: shake.get(pulse, unknown) for pulse in pulses}
