"""The triplet tag (`svev.TripletTag`): what became of one pulse in every camera.

Its JSON form is fixed. 64-bit integers are strings in it, because JavaScript would round numbers. Encoding, checks and
the JSON schema that stands in every log come from the types below.
"""

from typing import Annotated, Any, Final

import msgspec
from msgspec import UNSET, Meta, UnsetType

from rig.clocks import DeviceNs, UtcNs
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.topics import TAG
from rig.transport import wire


class CameraTag(
    msgspec.Struct,
    frozen=True,
    rename={"device_time": "device_time_ns", "host_time": "host_time_ns", "stamped": "stamped_pixels"},
):
    """One camera's part of a tag; ids and times are null unless the status is ok."""

    name: str
    columns: Annotated[tuple[int, int], Meta(description="first column and one past the last in the triplet")]
    status: FrameStatus
    frame_id: int | None = None
    trigger_count: int | None = None
    device_time: DeviceNs | None = None
    host_time: Annotated[UtcNs | None, Meta(description="UTC time at which the frame was in the host's memory, ns")] = (
        None
    )
    offset_us: Annotated[
        float | None, Meta(description="trigger time of this frame minus the pulse's, common time line, us")
    ] = None
    stamped: (
        Annotated[
            tuple[int, int, int],
            Meta(
                description="pixels that are a signature of the camera, no picture: row and first column in the "
                "triplet, count; left out if there are none"
            ),
        ]
        | UnsetType
    ) = UNSET


class TripletTag(msgspec.Struct, frozen=True, rename={"time": "time_ns"}):
    """What became of one trigger pulse in every camera; one per pulse, also where no frame came."""

    pulse: Annotated[PulseNumber, Meta(ge=1, description="number of the trigger pulse in this recording")]
    time: Annotated[UtcNs, Meta(description="time of the pulse, UTC, ns")]
    session: str
    recording: str
    shape: Annotated[tuple[int, int], Meta(description="rows, columns of the triplet")]
    cameras: tuple[CameraTag, ...]
    complete: Annotated[bool, Meta(description="every camera delivered its frame")] = False
    dtype: str = "uint8"

    def __post_init__(self) -> None:
        """Derive `complete` from the cameras, whatever value was given."""
        complete = all(camera.status is FrameStatus.OK for camera in self.cameras)
        msgspec.structs.force_setattr(self, "complete", complete)

    def encode(self) -> bytes:
        """The tag as JSON in UTF-8."""
        return wire.encode(self)

    @classmethod
    def decode(cls, text: bytes | memoryview) -> "TripletTag":
        """Read what `encode` wrote.

        Raises:
            ValueError: the bytes are not the JSON of a tag.
        """
        try:
            tag: TripletTag = _DECODER.decode(text)
        except (msgspec.MsgspecError, RecursionError) as error:
            raise ValueError(str(error)) from None
        return tag


_DECODER: Final = wire.decoder(TripletTag)

#: The JSON schema of a tag.
TAG_SCHEMA: Final[dict[str, Any]] = wire.schema(TripletTag, TAG.schema)
