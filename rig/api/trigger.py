"""Who makes the pulses and what of that can be changed, as the REST API tells and takes it."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from rig.api.fields import Model


class TriggerControl(StrEnum):
    """What can be changed of the pulses while the rig is armed."""

    RATE = "rate"  #: their rate


class TriggerChange(Model):
    """What is to be changed; what is left out stays as it is."""

    rate_hz: Annotated[float, Field(ge=0.1, le=1000, strict=True)] | None = Field(
        None, description="pulses per second; exposures and readout must be shorter than from pulse to pulse",
        examples=[50],
    )  # fmt: skip
    save: Annotated[bool, Field(strict=True)] = Field(
        False, description="write the rate into the rig file as well", examples=[False]
    )


class TriggerView(Model):
    """Who makes the pulses, and at what rate."""

    source: str = Field(description="`[trigger] source` of the rig file")
    rate_hz: float = Field(description="pulses per second that the source is to make")
    controls: tuple[TriggerControl, ...] = Field(description="what can be changed here; none: others make the pulses")
    saved: bool = Field(description="whether the rig file says the same rate, so that a restart keeps it")
