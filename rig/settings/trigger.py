"""The settings of the trigger: who makes the pulses. One class for each source; `[trigger] source` names it."""

from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field

from rig.settings.strict_toml import StrictModel

#: A command to expose begins so late at most, as a share of the period, or it is not given at all.
_LATEST: Final = 0.1
#: It may be so long on its way, or its moment is not known.
_LONGEST: Final = 0.1


class TriggerSettings(StrictModel):
    """What all sources have in common."""

    rate_hz: float = Field(30.0, ge=0.1, le=1000, description="pulses per second")
    settle_s: float = Field(5.0, gt=0, le=120, description="wait at most this long for the first pulses")
    min_cameras: int | None = Field(
        None, ge=1, le=8, description="with fewer cameras than this the rig is not armed; left out: all of them"
    )

    @property
    def period_ns(self) -> int:
        """Nominal time between two pulses, ns."""
        return round(1e9 / self.rate_hz)


class ExternalTrigger(TriggerSettings):
    """A pulse generator, whose cable leads to all cameras: the edge of a pulse exposes all at the same instant."""

    source: Literal["external"] = Field("external", description="a generator that svev knows nothing of")


class SoftwareTrigger(TriggerSettings):
    """Commands from this computer, one to each camera for each pulse: without a cable, for set-up only."""

    source: Literal["software"] = Field(description="commands to each camera, for set-up only")

    @property
    def latest_ns(self) -> int:
        """A command that would begin later than this after its pulse is not given, ns."""
        return round(_LATEST * self.period_ns)

    @property
    def longest_ns(self) -> int:
        """The longest way of a command for which its moment counts as known, ns."""
        return round(_LONGEST * self.period_ns)


def _external_unless_said(table: Any) -> Any:
    """A table that names no source means `external`."""
    return {"source": "external", **table} if isinstance(table, dict) else table


#: The `[trigger]` table: one of the sources, told by `source`.
Trigger = Annotated[
    Annotated[ExternalTrigger | SoftwareTrigger, Field(discriminator="source")],
    BeforeValidator(_external_unless_said),
]
