"""What the bus process is told when it begins: one line of JSON."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

#: How a camera signs its images: the manual does not say in which byte order.
Signature = Literal["big", "little", "none"]
_GUID_DIGITS = 16


def guid_number(text: str) -> int:
    """A camera's GUID from its 16 hexadecimal digits.

    Raises:
        ValueError: it is none.
    """
    try:
        number = int(text, 16)
    except ValueError:
        number = -1
    if number < 0 or len(text) != _GUID_DIGITS:
        raise ValueError(f'"{text}" is no GUID: give its 16 hexadecimal digits, e.g. 000a4701011b0001')
    return number


def _guid(text: str) -> str:
    return f"{guid_number(text):016x}"


class BusConfig(BaseModel):
    """One emulated bus."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    cameras: dict[str, Annotated[str, AfterValidator(_guid)]] = Field(
        min_length=1, max_length=16, description="GUID by name in the scenario, in the order of the bus"
    )
    socket: str = Field(min_length=2, max_length=100, description="name of the socket for the shim; @name: abstract")
    scenario: Path
    rate_hz: float = Field(gt=0, le=10_000, description="of the hill's trigger pulses")
    epoch: int = Field(description="host time of hill pulse 0, ns")
    test_pattern: bool = Field(False, description="show a plain pattern instead of the hill: costs nothing")
    signature: Signature = Field("big", description="byte order of the secure image signature; none: old firmware")
    permitted: bool = Field(True, description="whether programs may open /dev/fw*")
