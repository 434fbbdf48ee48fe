"""What a worker finds, and the main figures of a jump for people who wait for them."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Protocol

from analysis.cameras.oriented_scene import OrientedScene
from analysis.report.course import course_of
from analysis.report.figures import EARLY_S, FAR_M
from analysis.result.model import Jump, MeasuredRecording, Quantity
from rig.api.jump import LastJump, MeasuredValue
from rig.clocks import NS_PER_S, UtcNs
from rig.events import Level
from rig.jumper import JumperState
from rig.phrase import Phrase
from rig.pulse import PulseNumber


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredJump:
    """A whole jump.

    Attributes:
        result: the recording with this jump alone.
        summary: its main figures.
    """

    result: MeasuredRecording
    summary: LastJump


class Findings(Protocol):
    """Takes what a worker finds, in the order in which it is found."""

    def state(self, state: JumperState) -> None:
        """A measured pulse."""

    def scene(self, recording: str, pulse: PulseNumber, time: UtcNs, scene: bytes) -> None:
        """The scene in 3D at a pulse, an encoded `foxglove.SceneUpdate`."""

    def cameras(self, recording: str, pulse: PulseNumber, time: UtcNs, frames: bytes) -> None:
        """Where the cameras stand in the scene from a pulse on, an encoded `foxglove.FrameTransforms`."""

    def oriented(self, recording: str, time: UtcNs, scene: OrientedScene) -> None:
        """The cameras were oriented, in the pictures of a recording until this time."""

    def jump(self, jump: MeasuredJump) -> None:
        """A whole jump."""

    def message(self, level: Level, said: Phrase) -> None:
        """Something that people should know, one line."""


def summary(recording: str, rate_hz: float, jump: Jump, perpendicular: Quantity | None) -> LastJump:
    """The main figures of a jump.

    Args:
        recording: its name.
        rate_hz: pulses per second.
        jump: the jump.
        perpendicular: velocity perpendicular to the table at the take-off, m/s.
    """
    course = course_of(jump, rate_hz)
    time = jump.pulses[0].time if jump.takeoff is None else jump.takeoff.time
    return LastJump(
        recording=recording,
        jump=jump.number,
        time=datetime.fromtimestamp(time / NS_PER_S, UTC),
        ok=jump.verdict.ok,
        verdict=jump.verdict.message,
        said=jump.verdict.said,
        takeoff_speed=_value(course.at_time("speed", 0.0)),
        perpendicular=_value(perpendicular),
        speed_20_m=_value(course.at_distance("speed", FAR_M)),
        angle_of_attack=_value(course.at_time("angle_of_attack", EARLY_S)),
        ski_to_body=_value(course.at_time("alpha", EARLY_S)),
    )


def _value(quantity: Quantity | None) -> MeasuredValue | None:
    return None if quantity is None else MeasuredValue(value=quantity.value, sigma=quantity.sigma)
