"""The jumper at one pulse (`svev.JumperState`), as it travels to the log and to subscribers.

The JSON form is that of the smoothed part of a pulse in `jumper.json` (`svev-jumper/1`): lengths m, speeds m/s, angles
in degrees; what was never measured is null. A live state knows the pulses until its own, and none after it: a part
that was measured before and not at this pulse has the status `predicted` and a sigma that says so.
"""

from typing import Annotated, Final

import msgspec
from msgspec import Meta

from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from rig.topics import JUMPER
from rig.transport import wire

Triple = tuple[float, float, float]


class Measured(msgspec.Struct, frozen=True):
    """A number with its standard deviation."""

    value: float
    sigma: float


class JumperPoint(msgspec.Struct, frozen=True):
    """A point of the jumper."""

    X: Annotated[Triple, Meta(description="coordinates, m")]
    covariance: Annotated[tuple[Triple, Triple, Triple], Meta(description="m^2, row by row")]
    cameras: tuple[str, ...]
    status: Annotated[str, Meta(description="controlled, two rays, predicted or by hand")]


class JumperSki(msgspec.Struct, frozen=True):
    """A ski."""

    direction: Annotated[Triple, Meta(description="unit vector, tail to tip")]
    slope: Annotated[Measured, Meta(description="above the horizontal, degrees")]
    heading: Annotated[Measured, Meta(description="from X towards Y, degrees")]
    cameras: tuple[str, ...]
    status: Annotated[str, Meta(description="controlled, two rays, predicted or by hand")]


class JumperVector(msgspec.Struct, frozen=True):
    """A vector."""

    value: Triple
    covariance: Annotated[tuple[Triple, Triple, Triple], Meta(description="row by row")]


class JumperState(msgspec.Struct, frozen=True, kw_only=True, rename={"time": "time_ns"}):
    """The jumper at one pulse."""

    recording: str
    jump: Annotated[int, Meta(ge=1, description="number of the jump in the recording")]
    pulse: Annotated[PulseNumber, Meta(ge=1)]
    time: Annotated[UtcNs, Meta(description="middle of the exposure, UTC, ns")]
    since_takeoff_s: Annotated[float | None, Meta(description="null before the take-off is known")] = None
    phase: Annotated[str | None, Meta(description="table, edge or flight; null before the take-off is known")] = None
    points: dict[str, JumperPoint | None]
    skis: dict[str, JumperSki | None]
    angles: dict[str, Measured | None]
    height: Measured | None
    speed: Measured | None
    velocity: Annotated[JumperVector | None, Meta(description="of the middle of the bindings, m/s")] = None
    angle_of_attack: Annotated[Measured | None, Meta(description="skis against the path, degrees")] = None

    def encode(self) -> bytes:
        """The state as JSON in UTF-8."""
        return wire.encode(self)

    @classmethod
    def decode(cls, text: bytes | memoryview) -> "JumperState":
        """Read what `encode` wrote.

        Raises:
            ValueError: the bytes are not the JSON of a state.
        """
        try:
            state: JumperState = _DECODER.decode(text)
        except (msgspec.MsgspecError, RecursionError) as error:
            raise ValueError(str(error)) from None
        return state


_DECODER: Final = wire.decoder(JumperState)

#: The JSON schema of a state.
JUMPER_SCHEMA: Final[dict[str, object]] = wire.schema(JumperState, JUMPER.schema)
