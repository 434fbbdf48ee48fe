"""By how much the pose of one camera changed, from the displacements of balls in its image.

Both poses see the same balls, so what the survey of a ball has wrong is in both and cancels: only the noise of the
images counts. Turns are about the camera's own axes, R' = R exp([d]x), shifts are in the object system. A ball that was
itself moved is found by its residual and left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc, chdtri

from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.rotation import rotation_from_vector, vector_from_rotation
from rig.arrays import Flags, Floats

FEWEST: Final = 3  #: balls that show a turn and whether they agree
_FEWEST_FOR_SHIFT = 6  # balls that show a shift too, and whether they agree
_SHIFT_RISK = 1e-3  # chance that a shift is taken where there is none
_BALL_RISK = 1e-3  # chance that any sound ball of an image is left out
_MOST_LEFT_OUT = 0.4  # share of the balls
_STEPS_MOST, _SETTLED_SIGMAS = 6, 1e-3  # iterations, sigmas


@dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """Where one camera shows balls at two times.

    Attributes:
        names: of n balls.
        xyz: (n, 3) in the object system.
        before: (n, 2) px.
        after: (n, 2) px.
        covariance: (n, 2, 2) of the difference, px^2.
    """

    names: tuple[str, ...]
    xyz: Floats
    before: Floats
    after: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PoseChange:
    """A change of a pose.

    Attributes:
        turn: (3,) rad, about the camera's own axes before the change.
        shift: (3,) of the projection centre; zero where the balls do not show one.
        covariance: (6, 6) of shift and turn, in this order; zero for a shift that is not estimated.
        used: names of the balls that agree.
        left_out: names of those that do not, because they moved themselves or were measured wrong.
        factor: a-posteriori / a-priori standard deviation of the displacements.
    """

    turn: Floats
    shift: Floats
    covariance: Floats
    used: tuple[str, ...]
    left_out: tuple[str, ...]
    factor: float

    @property
    def has_shift(self) -> bool:
        """Whether a shift was estimated."""
        return bool(self.covariance[0, 0] > 0)

    def p(self, more: Floats | None = None) -> float:
        """Probability of such a change in a camera that did not move.

        Args:
            more: (6, 6) added to the covariance: what else may make a difference.
        """
        values, columns = np.concatenate((self.shift, self.turn)), slice(0 if self.has_shift else 3, 6)
        total = (self.covariance + (np.zeros((6, 6)) if more is None else more))[columns, columns]
        return float(chdtrc(len(total), values[columns] @ np.linalg.solve(total, values[columns])))

    def applied(self, placed: PlacedCamera) -> PlacedCamera:
        """The camera after the change."""
        return replace(
            placed,
            position=placed.position + self.shift,
            rotation=placed.rotation @ rotation_from_vector(self.turn),
        )


def pose_change(placed: PlacedCamera, seen: Displacements) -> PoseChange | None:
    """The change of a camera's pose; None if fewer than three balls agree.

    Args:
        placed: the camera before.
        seen: displacements of balls.
    """
    sound = np.isfinite(seen.after).all(axis=1) & placed.in_front(seen.xyz)
    kept = _agreeing(placed, seen, sound, 6) if sound.sum() >= _FEWEST_FOR_SHIFT else None
    if kept is not None:
        turned, shifted = (_fitted(placed, seen, kept, parameters) for parameters in (3, 6))
        gain = turned.square_sum - shifted.square_sum
        if gain > float(chdtri(3, _SHIFT_RISK)) * max(1.0, shifted.factor(kept)) ** 2:
            return _result(shifted, seen, kept, sound)
    kept = _agreeing(placed, seen, sound, 3)
    return None if kept is None else _result(_fitted(placed, seen, kept, 3), seen, kept, sound)


def changed(system: CameraSystem, changes: Mapping[str, PoseChange]) -> CameraSystem:
    """The cameras after changes of some, whose covariance is added to that of the poses."""
    covariance = system.covariance.copy()
    cameras = dict(system.cameras)
    for name, change in changes.items():
        cameras[name] = change.applied(system[name])
        pose = system[name].columns[:6]
        covariance[np.ix_(pose, pose)] += change.covariance
    return CameraSystem(cameras, covariance)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Least squares of the last 3 (turn) or all 6 (shift, turn) elements."""

    values: Floats
    cofactors: Floats
    squares: Floats  # (n,) of each ball, in units of its covariance; all balls, also those that are not kept
    square_sum: float
    parameters: int

    def factor(self, kept: Flags) -> float:
        freedom = 2 * int(kept.sum()) - self.parameters
        return float(np.sqrt(self.square_sum / freedom)) if freedom > 0 else 1.0


def _agreeing(placed: PlacedCamera, seen: Displacements, sound: Flags, parameters: int) -> Flags | None:
    """The balls that move as one, without those that do not, the worst first; None if too few are left."""
    kept = sound.copy()
    fewest = max(FEWEST, -(-parameters // 2) + 1, int(np.ceil((1 - _MOST_LEFT_OUT) * sound.sum())))
    while kept.sum() >= fewest:
        fit = _fitted(placed, seen, kept, parameters)
        gate = float(chdtri(2, _BALL_RISK / max(1, int(kept.sum()))))
        inside = np.flatnonzero(kept)
        # without the worst ball: its own residual is then free of its pull
        worst = inside[int(fit.squares[inside].argmax())]
        less = kept.copy()
        less[worst] = False
        if less.sum() < FEWEST:
            return kept if fit.squares[worst] < gate else None
        if _fitted(placed, seen, less, parameters).squares[worst] < gate * max(1.0, fit.factor(kept)) ** 2:
            return kept
        kept = less
    return None


def _fitted(placed: PlacedCamera, seen: Displacements, kept: Flags, parameters: int) -> _Fit:
    """Gauss-Newton from the pose before."""
    position, rotation = placed.position, placed.rotation
    before = placed.project(seen.xyz)
    values, cofactors = np.zeros(6), np.zeros((6, 6))
    weight = np.linalg.inv(seen.covariance)
    chosen = slice(6 - parameters, 6)
    current = placed
    for _ in range(_STEPS_MOST):
        predicted = seen.before + (current.project(seen.xyz) - before)
        by_pose = current.linearised(seen.xyz, predicted)[2][:, :, :6][:, :, chosen]
        v = np.nan_to_num(seen.after - predicted)
        normal = np.einsum("nia,nij,njb->ab", by_pose[kept], weight[kept], by_pose[kept])
        step = np.linalg.lstsq(normal, np.einsum("nia,nij,nj->a", by_pose[kept], weight[kept], v[kept]), rcond=None)[0]
        whole = np.zeros(6)
        whole[chosen] = step
        current = replace(
            current,
            position=current.position + whole[:3],
            rotation=current.rotation @ rotation_from_vector(whole[3:]),
        )
        if float(step @ normal @ step) < _SETTLED_SIGMAS**2:
            break
    values[:3] = current.position - position
    values[3:] = vector_from_rotation(rotation.T @ current.rotation)
    cofactors[chosen, chosen] = np.linalg.pinv(normal, hermitian=True)
    v = np.nan_to_num(seen.after - (seen.before + current.project(seen.xyz) - before), nan=1e6)
    # a ball that takes no part has the uncertainty of the prediction on top
    from_pose = np.einsum("nia,ab,njb->nij", by_pose, cofactors[chosen, chosen], by_pose)
    total = np.where(kept[:, None, None], seen.covariance, seen.covariance + from_pose)
    squares = np.einsum("ni,nij,nj->n", v, np.linalg.inv(total), v)
    return _Fit(values, cofactors, squares, float(squares[kept].sum()), parameters)


def _result(fit: _Fit, seen: Displacements, kept: Flags, sound: Flags) -> PoseChange:
    factor = fit.factor(kept)
    return PoseChange(
        fit.values[3:],
        fit.values[:3],
        fit.cofactors * max(1.0, factor) ** 2,
        tuple(name for name, good in zip(seen.names, kept, strict=True) if good),
        tuple(n for n, good, ok in zip(seen.names, kept, sound, strict=True) if ok and not good),
        factor,
    )
