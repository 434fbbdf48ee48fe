"""Who makes the pulses and what of that can be changed, as the REST API tells and takes it."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field, StrictBool

from rig.api.fields import WHOLE, Model


class TriggerControl(StrEnum):
    """What can be changed of the pulses while the rig is armed."""

    RATE = "rate"  #: their rate
    RUNNING = "running"  #: whether they come by themselves; else they come on request, so many as are asked for


class TriggerChange(Model):
    """What is to be changed; what is left out stays as it is."""

    rate_hz: Annotated[float, Field(ge=0.1, le=1000, strict=True)] | None = Field(
        None, description="pulses per second; exposures and readout must be shorter than from pulse to pulse",
        examples=[50],
    )  # fmt: skip
    running: StrictBool | None = Field(
        None, description="false: stop the pulses, which come on request then; true: start them", examples=[None]
    )
    save: StrictBool = Field(False, description="write the rate into the rig file as well", examples=[False])


class BurstOrder(Model):
    """Pulses on request."""

    pulses: Annotated[int, Field(ge=1, le=10_000), WHOLE] = Field(10, description="so many", examples=[10])


class TriggerView(Model):
    """Who makes the pulses, and at what rate."""

    source: str = Field(description="`[trigger] source` of the rig file")
    rate_hz: float = Field(description="pulses per second that the source is to make")
    controls: tuple[TriggerControl, ...] = Field(description="what can be changed here; none: others make the pulses")
    running: bool = Field(description="whether pulses come by themselves while armed; else on request only")
    saved: bool = Field(description="whether the rig file says the same rate, so that a restart keeps it")
