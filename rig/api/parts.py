"""When a recording goes on in its next part, as the REST API tells and takes it."""

from typing import Annotated, Final

from pydantic import Field, StrictBool

from rig.api.fields import Model

_SECONDS: Final = "a recording goes on in another log, its next part, after so many seconds; null: whatever it lasts"
_SIZE: Final = "the same before a log is larger than this, 10^9 bytes; null: however large; both: whichever comes first"


class PartsChange(Model):
    """What is to be changed; what is left out stays as it is."""

    part_s: Annotated[float, Field(ge=1, le=86_400, strict=True)] | None = Field(
        None, description=_SECONDS, examples=[600]
    )
    part_gb: Annotated[float, Field(ge=0.001, le=1e6, strict=True)] | None = Field(
        None, description=_SIZE, examples=[4]
    )
    save: StrictBool = Field(False, description="write both into the rig file as well", examples=[False])


class PartsView(Model):
    """How recordings are split from the next one on."""

    part_s: float | None = Field(description=_SECONDS)
    part_gb: float | None = Field(description=_SIZE)
    saved: bool = Field(description="whether the rig file says the same, so that a restart keeps it")
