"""What was measured of the last jump, in the form of the REST API."""

from datetime import datetime

from pydantic import Field

from rig.api.fields import Model
from rig.phrase import Phrase


class MeasuredValue(Model):
    """A number with its standard deviation."""

    value: float
    sigma: float


class LastJump(Model):
    """Main figures of the jump that was measured last, m/s and degrees; null where not measured."""

    recording: str
    jump: int = Field(description="number of the jump in the recording")
    time: datetime = Field(description="take-off, or first pulse where that was not found, UTC")
    live: bool = Field(False, description="measured while it was recorded: `ok` is false then, the log tells more")
    ok: bool = Field(description="whether the jump was measured well")
    verdict: str = Field(description="the verdict in words")
    said: tuple[Phrase, ...] = Field(
        (), description="the same sentence by sentence, for translation: what speaks against the jump stands first"
    )
    takeoff_speed: MeasuredValue | None = None
    perpendicular: MeasuredValue | None = Field(None, description="velocity perpendicular to the table at the take-off")
    speed_20_m: MeasuredValue | None = Field(None, description="speed 20 m behind the edge")
    angle_of_attack: MeasuredValue | None = Field(None, description="0.5 s after the take-off")
    ski_to_body: MeasuredValue | None = Field(None, description="alpha, 0.5 s after the take-off")
