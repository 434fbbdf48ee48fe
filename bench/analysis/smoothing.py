"""Whether the sigmas of smoothed jumps hold, also where a marker or a ski was not measured for a while.

Each draw is another jump, another survey and other errors of the measurements. It is smoothed as measured, and once
more with a marker or a ski blanked in all cameras over a phase. Measurements are simulated, not rendered.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from analysis.measurements.model import ImageMeasurements, JumpMeasurements
from analysis.motion.model.observations import GROUPS
from analysis.motion.smoother import Motion, smooth
from analysis.result.model import Phase, SmoothedState, Status, phase_at
from bench.analysis.simulated import RATE_HZ, TrueJump, drawn, simulated_measurements, training, true_cameras, true_jump
from photogrammetry.jumper.stick_model import ANGLES, body_angles, slope
from rig.arrays import Floats

#: What is blanked, one after the other from draw to draw.
BLANKED: Final = tuple((group, phase) for phase in Phase for group in GROUPS)
_WITHIN: Final = 2.0  # sigmas
_GOLDEN: Final = 0.6180339887  # of a pulse, from draw to draw: the take-off lies anywhere between two pulses


@dataclass(slots=True)
class Honesty:
    """Errors with their sigmas.

    Attributes:
        pairs: by phase and quantity, error and sigma.
        jumps: for each of them, of which jump it is.
    """

    pairs: dict[tuple[str, str], list[tuple[float, float]]] = field(default_factory=lambda: defaultdict(list))
    jumps: dict[tuple[str, str], list[int]] = field(default_factory=lambda: defaultdict(list))
    _jump: int = 0

    def begin(self) -> None:
        """What is added from now on is of another jump."""
        self._jump += 1

    def add(self, phase: str, quantity: str, error: float, sigma: float) -> None:
        """Add one error."""
        self.pairs[phase, quantity].append((error, sigma))
        self.jumps[phase, quantity].append(self._jump)

    def figures(self) -> dict[str, dict[str, Any]]:
        """By phase and quantity: number of errors, mean square of error over sigma, share within two sigmas, sizes.

        `known_to` is the standard deviation of the mean square, as the jumps show it: the errors of one are correlated.
        """
        out = {}
        for key, pairs in sorted(self.pairs.items()):
            error, sigma = np.array(pairs).T
            z, scatter = error / sigma, float(np.sqrt(np.mean(error**2)))
            out[" ".join(key)] = {
                "n": len(z),
                "mean_square": round(float(np.mean(z**2)), 3),
                "known_to": _known_to(z**2, self.jumps[key]),
                "within_2_sigma": round(float(np.mean(np.abs(z) < _WITHIN)), 3),
                "mean_sigma": float(np.mean(sigma)),
                "sigma_over_scatter": round(float(np.mean(sigma)) / scatter, 3),
            }
        return out


def run_smoothing(draws: int) -> list[dict[str, Any]]:
    """Smooth simulated jumps and judge their sigmas.

    Args:
        draws: of jump, survey and errors; each thing that is blanked gets its share of them.

    Returns:
        Cases: everything measured, then each marker and ski blanked in each phase; with the figures of `Honesty`.
    """
    whole, blanked = Honesty(), {case: Honesty() for case in BLANKED}
    for draw in range(draws):
        case = BLANKED[draw % len(BLANKED)]
        _judge_draw(draw, case, whole, blanked[case])
    cases = [{"name": "everything measured", "draws": draws, "honesty": whole.figures()}]
    for k, ((group, phase), judged) in enumerate(blanked.items()):
        count = len(range(k, draws, len(BLANKED)))
        if count:
            name = f"{group} not measured in phase {phase.value}"
            cases.append({"name": name, "draws": count, "honesty": judged.figures()})
    return cases


def _judge_draw(draw: int, case: tuple[str, Phase], whole: Honesty, blanked: Honesty) -> None:
    rng = np.random.default_rng(draw)
    scenario = training().model_copy(update={"first_takeoff_s": 1.0 + draw * _GOLDEN % 1.0 / RATE_HZ})
    truth = true_jump(draw, RATE_HZ, scenario)
    measured = simulated_measurements(truth, true_cameras(), rng)
    system, jump = drawn(true_cameras(), rng), measured.jumps[0]
    judge(truth, jump, smooth(jump, measured, system), whole)
    without = blanked_out(jump, truth, *case)
    judge(truth, without, smooth(without, measured, system), blanked)


def blanked_out(jump: JumpMeasurements, truth: TrueJump, group: str, phase: Phase) -> JumpMeasurements:
    """A jump without the measurements of a marker or a ski in a phase."""

    def without(image: ImageMeasurements) -> ImageMeasurements:
        points = {name: point for name, point in image.points.items() if name != group}
        return ImageMeasurements(points, {side: ski for side, ski in image.skis.items() if side != group})

    pulses = tuple(
        replace(pulse, images={name: without(image) for name, image in pulse.images.items()})
        if phase_at(truth.since_takeoff(pulse.pulse)) is phase
        else pulse
        for pulse in jump.pulses
    )
    return replace(jump, pulses=pulses)


def _known_to(squares: Floats, jumps: list[int]) -> float | None:
    """Standard deviation of a mean of squares that are independent from jump to jump only; None of a single jump."""
    of_jumps = np.bincount(jumps, squares - squares.mean())
    count = len(set(jumps))
    return round(float(np.sqrt(np.sum(of_jumps**2) * count / (count - 1)) / len(squares)), 3) if count > 1 else None


def judge(truth: TrueJump, jump: JumpMeasurements, motion: Motion, honesty: Honesty) -> None:
    """Add the errors of a smoothed jump."""
    honesty.begin()
    for pulse, state in zip(jump.pulses, motion.states, strict=True):
        if state is not None:
            phase = phase_at(truth.since_takeoff(pulse.pulse)).value
            for quantity, error, sigma in _errors(truth, pulse.pulse, state):
                honesty.add(phase, quantity, error, sigma)
    if motion.takeoff is not None:
        error = motion.takeoff.pulse - truth.takeoff_pulse
        honesty.add("all", "takeoff", error, motion.takeoff.sigma_pulses)


def _errors(truth: TrueJump, pulse: int, state: SmoothedState) -> Iterator[tuple[str, float, float]]:
    """Quantity, error and sigma of everything that is stated."""
    pose, velocity = truth.pose(pulse), truth.velocity(pulse)
    for (label, point), true in zip(state.points.items(), pose.markers, strict=True):
        if point is not None:
            kind = f"{label} predicted" if point.status is Status.PREDICTED else label
            for error, variance in zip(point.xyz - true, np.diagonal(point.covariance), strict=True):
                yield kind, float(error), float(np.sqrt(variance))
    helmet, hip = pose.markers[:2]
    angles = np.degrees(body_angles(helmet, hip, pose.origin, *pose.skis))
    expected = dict(zip(ANGLES, angles, strict=True))
    expected |= {"height": pose.origin[2], "speed": float(np.linalg.norm(velocity))}
    expected["angle_of_attack"] = expected["phi"] - float(np.degrees(slope(velocity)))
    found = {**state.angles, "height": state.height, "speed": state.speed, "angle_of_attack": state.angle_of_attack}
    for name, quantity in found.items():
        if quantity is not None:
            yield name, quantity.value - float(expected[name]), quantity.sigma
    for axis, row in zip("xyz", range(3), strict=True):
        sigma = float(np.sqrt(state.velocity.covariance[row, row]))
        yield f"velocity {axis}", float(state.velocity.value[row] - velocity[row]), sigma
