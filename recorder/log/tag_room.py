"""Whether the tags of a recording fit before the pixels of a triplet, whatever becomes of its pulses."""

from collections.abc import Sequence
from typing import Final

from recorder.log.mcap_layout import SlotLayout
from rig.clocks import DeviceNs, UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.pixels import Pixels
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag

_LARGEST: Final = (1 << 63) - 1
_LONGEST_OFFSET_US: Final = -1.2345678901234567e-300
#: A recording that goes on in another log has a longer name there.
_LONGER_NAME: Final = "-" * 32


def check_tag_fits(layout: SlotLayout, cameras: Sequence[str], session: str, recording: str) -> None:
    """Check the longest tag that a recording can have.

    Args:
        layout: of the slots of its triplets.
        cameras: names of the cameras.
        session: name of the session.
        recording: id of the recording.

    Raises:
        BadInputError: it does not fit.
    """
    longest = _longest_tag(layout.shape, layout.kind, cameras, session, recording + _LONGER_NAME)
    if (too_many := len(longest) - layout.most_tag_bytes) > 0:
        raise BadInputError(
            f"the names of session and recording take {too_many} bytes too many for the tags of the log: shorten them"
        )


def _longest_tag(shape: tuple[int, int], kind: Pixels, cameras: Sequence[str], session: str, recording: str) -> bytes:
    number, time = PulseNumber(_LARGEST), UtcNs(_LARGEST)
    pixels = (shape[0], shape[1], _LARGEST)
    device, offset = DeviceNs(_LARGEST), _LONGEST_OFFSET_US
    parts = tuple(
        CameraTag(name, shape, FrameStatus.OK, number, number, device, time, offset, pixels, shape[0])
        for name in cameras
    )
    return TripletTag.made(number, time, session, recording, shape, parts, kind).encode()
