"""The triplet tag (`svev.TripletTag`): what became of one pulse in every camera.

Its JSON form is fixed. 64-bit integers are strings in it, because JavaScript would round numbers. Encoding, checks and
the JSON schema that stands in every log come from the types below.
"""

from typing import Annotated, Final

import msgspec
from msgspec import UNSET, Meta, UnsetType

from rig.clocks import DeviceNs, UtcNs
from rig.frame import FrameStatus
from rig.images.pixels import Pixels
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
    rows: (
        Annotated[
            int, Meta(ge=1, description="rows of the camera's frame; left out if the frame is as high as the triplet")
        ]
        | UnsetType
    ) = UNSET

    @property
    def part(self) -> tuple[slice, slice]:
        """The camera's frame in the triplet, (rows, columns)."""
        return slice(None if self.rows is UNSET else self.rows), slice(*self.columns)

    def size(self, shape: tuple[int, int]) -> tuple[int, int]:
        """Width and height of the camera's frames, px, in a triplet of so many rows and columns."""
        return int(self.columns[1] - self.columns[0]), int(shape[0] if self.rows is UNSET else self.rows)


class TripletTag(msgspec.Struct, frozen=True, rename={"time": "time_ns"}):
    """What became of one trigger pulse in every camera; one per pulse, also where no frame came."""

    pulse: Annotated[PulseNumber, Meta(ge=1, description="number of the trigger pulse in this recording")]
    time: Annotated[UtcNs, Meta(description="time of the pulse, UTC, ns")]
    session: str
    recording: str
    shape: Annotated[tuple[int, int], Meta(description="rows, columns of the triplet")]
    cameras: tuple[CameraTag, ...]
    complete: Annotated[bool, Meta(description="every camera delivered its frame")] = False
    dtype: Annotated[str, Meta(description="uint8, or uint16 with the lower byte first")] = "uint8"
    encoding: Annotated[str, Meta(description="of the pixels, of a mosaic of colours; left out: grey")] | UnsetType = (
        UNSET
    )
    bits: (
        Annotated[int, Meta(description="how many bits of a pixel are significant, the lowest ones; left out: 8")]
        | UnsetType
    ) = UNSET

    @classmethod
    def made(
        cls, pulse: PulseNumber, time: UtcNs, session: str, recording: str, shape: tuple[int, int],
        cameras: tuple[CameraTag, ...], pixels: Pixels,
    ) -> "TripletTag":  # fmt: skip
        """A tag of a triplet with pixels of this kind."""
        encoding = pixels.encoding if pixels.is_mosaic else UNSET
        bits = UNSET if pixels.bits == 8 else pixels.bits
        dtype = pixels.dtype.name
        return cls(pulse, time, session, recording, shape, cameras, dtype=dtype, encoding=encoding, bits=bits)

    @property
    def pixels(self) -> Pixels:
        """How the triplet holds its pixels.

        Raises:
            ValueError: as no triplet of ours does.
        """
        bits = 8 if self.bits is UNSET else self.bits
        encoding = ("mono8" if bits == 8 else "mono16") if self.encoding is UNSET else self.encoding
        found = Pixels(encoding, bits)
        if self.dtype != found.dtype.name:
            raise ValueError(f"no pixels of ours: {self.dtype} with {found.bits} significant bits")
        return found

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
TAG_SCHEMA: Final[dict[str, object]] = wire.schema(TripletTag, TAG.schema)
