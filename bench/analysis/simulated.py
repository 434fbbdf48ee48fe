"""Cameras and measurements of a simulated jump without images: what perfect detection would measure, plus noise.

The truth comes from `simrig`; its cameras are oriented by a simulated network of balls. `drawn` makes the cameras that
one survey and one orientation would have given: the true ones, changed by a draw from their covariance.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from analysis.measurements.model import (
    POINTS,
    SIDES,
    ImageMeasurements,
    JumpMeasurements,
    MeasuredCamera,
    Measurements,
    PointMeasurement,
    PulseMeasurements,
    SkiMeasurement,
)
from analysis.scene.camera_system import CameraSystem, camera_system
from photogrammetry.network.file import network_from_json
from photogrammetry.procedures.orientation import orient
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from rig.settings.file import CONFIG
from simrig.world.jumper import Jump, JumpSeries, Pose
from simrig.world.scenario import Scenario, load_scenario

SIZE = (640, 480)
RATE_HZ = 30.0
SIGMA_PX = 0.15  #: of a marker's coordinates
SKI_SIGMA_PX = 0.3  #: of a point on a ski's axis
SKI_POINTS = 12
START_NS = 1_795_216_434_000_000_000  #: UTC of pulse 0


@cache
def training() -> Scenario:
    """The scenario that is shipped, without a stamp."""
    return load_scenario(CONFIG / "scenarios" / "training.toml").model_copy(update={"stamp": False})


@cache
def true_cameras(survey_sigma: float = 0.012, image_sigma: float = 0.1) -> CameraSystem:
    """The true cameras of the training scenario with the covariance that its balls give them."""
    scenario = training()
    cameras = {camera.name: {"size": list(SIZE), "c": camera.c} for camera in scenario.cameras}
    images, observations = {}, []
    for camera in scenario.cameras:
        projection = camera.projection(*SIZE)
        images[camera.name] = {"camera": camera.name, "X0": list(projection.X0), "R": projection.R.tolist()}
        for ball in scenario.balls:
            place = projection.pixels(ball.X)
            if projection.sees(place):
                observations.append([camera.name, ball.name, float(place[0]), float(place[1]), image_sigma])
    points = {
        ball.name: {"role": "control", "X": list(ball.X), "sigma": [survey_sigma] * 3}
        if ball.role == "control"
        else {"role": "tie", "X": None}
        for ball in scenario.balls
    }
    data = {
        "format": "svev-network/1",
        "image_frame": "pixel",
        "cameras": cameras,
        "images": images,
        "points": points,
        "observations": observations,
    }
    orientation = orient(network_from_json(data, "simulated"))
    system = camera_system(orientation, [camera.name for camera in scenario.cameras])
    # The observations are without error, so that the a-posteriori sigma0 says nothing: the a-priori one counts.
    ratio = orientation.outcome.adjustment.ratio
    given = None if system.given is None else system.given / ratio**2
    return CameraSystem(system.cameras, system.covariance / ratio**2, given)


def drawn(system: CameraSystem, rng: np.random.Generator) -> CameraSystem:
    """The cameras as one survey and one orientation would have given them."""
    values, vectors = np.linalg.eigh(system.covariance)
    return system.moved(vectors @ (np.sqrt(np.maximum(values, 0)) * rng.standard_normal(len(values))))


@dataclass(frozen=True, slots=True)
class TrueJump:
    """The truth of a simulated jump.

    Attributes:
        jump: gives pose and velocity at any time after the take-off.
        takeoff_pulse: pulse, with fraction, at whose middle of the exposure O passes the edge.
        rate_hz: pulses per second.
        ski_length: m.
    """

    jump: Jump
    takeoff_pulse: float
    rate_hz: float
    ski_length: float

    def since_takeoff(self, pulse: float) -> float:
        """Seconds."""
        return (pulse - self.takeoff_pulse) / self.rate_hz

    def pose(self, pulse: float) -> Pose:
        """The pose at the middle of a pulse's exposure."""
        return self.jump.pose(self.since_takeoff(pulse))

    def velocity(self, pulse: float) -> Floats:
        """Velocity of O, m/s."""
        return self.jump.velocity(self.since_takeoff(pulse))


def true_jump(seed: int, rate_hz: float = RATE_HZ, scenario: Scenario | None = None) -> TrueJump:
    """A jump of the training scenario as another seed draws it."""
    scenario = (scenario or training()).model_copy(update={"seed": seed})
    jump = JumpSeries(scenario).first()
    return TrueJump(jump, jump.takeoff_s * rate_hz, rate_hz, scenario.jumper.ski_length_m)


def simulated_measurements(
    truth: TrueJump,
    system: CameraSystem,
    rng: np.random.Generator,
    *,
    sigma_px: float = SIGMA_PX,
    ski_sigma_px: float = SKI_SIGMA_PX,
    late_s: dict[str, float] | None = None,
) -> Measurements:
    """What the true cameras measure of a jump: every point and ski in sight, in all pulses from -6 m to 26 m.

    Args:
        truth: the jump.
        system: the true cameras.
        rng: makes the errors of the measurements.
        sigma_px: of each coordinate of a point.
        ski_sigma_px: of each point of a ski across its axis.
        late_s: by camera, how much later it shows the scene than it says.
    """
    first, last = _in_sight(truth)
    pulses = []
    for pulse in range(first, last + 1):
        images = {}
        for name in system.names:
            late = (late_s or {}).get(name, 0.0) * truth.rate_hz
            images[name] = _measured(truth.pose(pulse + late), truth, system, name, rng, sigma_px, ski_sigma_px)
        time = UtcNs(START_NS + round(pulse * 1e9 / truth.rate_hz))
        pulses.append(PulseMeasurements(PulseNumber(pulse), time, images))
    cameras = {name: MeasuredCamera(SIZE, 0.0) for name in system.names}
    return Measurements("simulated", truth.rate_hz, cameras, (JumpMeasurements(1, tuple(pulses)),))


def _in_sight(truth: TrueJump) -> tuple[int, int]:
    pulses = [p for p in range(1, round(4 * truth.takeoff_pulse)) if -6 <= truth.pose(p).origin[0] <= 26]
    return pulses[0], pulses[-1]


def _measured(
    pose: Pose, truth: TrueJump, system: CameraSystem, name: str, rng: np.random.Generator, sigma: float, ski: float
) -> ImageMeasurements:
    placed = system[name]
    width, height = SIZE
    points = {}
    for label, xyz in zip(POINTS, pose.markers, strict=True):
        xy = placed.project(xyz)
        if 0 <= xy[0] <= width - 1 and 0 <= xy[1] <= height - 1:
            points[label] = PointMeasurement(xy + sigma * rng.standard_normal(2), sigma**2 * np.eye(2))
    skis = {}
    for side, binding, direction in zip(SIDES, pose.markers[2:], pose.skis, strict=True):
        along = np.linspace(-0.45, 0.45, SKI_POINTS)[:, None] * truth.ski_length
        xy = placed.project(binding + along * direction)
        inside = ((xy >= 0) & (xy <= np.array(SIZE) - 1)).all(axis=1)
        if inside.sum() >= 2:
            axis = xy[-1] - xy[0]
            across = np.array((-axis[1], axis[0])) / np.linalg.norm(axis)
            noisy = xy[inside] + ski * rng.standard_normal((inside.sum(), 1)) * across
            skis[side] = SkiMeasurement(noisy, np.full(int(inside.sum()), ski))
    return ImageMeasurements(points, skis)
