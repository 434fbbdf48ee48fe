"""What the doors let in fits into the log."""

import pytest

from recorder.log.mcap_layout import SlotLayout
from recorder.log.tag_room import check_tag_fits
from rig.api.fields import LONGEST_LINE
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.pulse import PulseNumber

NAMES = [f"a{number}" + "x" * 14 for number in range(8)]
SHAPE = (16, 8 * 16384)
RECORDING = "2026-11-22T10-00-00Z-100"


@pytest.mark.parametrize("character", ["x", "ø", "𝄞", '"', "\\"])
def test_the_longest_session_of_the_largest_rig_fits(character: str) -> None:
    check_tag_fits(SlotLayout(SHAPE), NAMES, character * LONGEST_LINE, RECORDING)


def test_a_longer_one_is_refused() -> None:
    with pytest.raises(BadInputError, match=r"names of session and recording take \d+ bytes too many .* shorten them"):
        check_tag_fits(SlotLayout(SHAPE), NAMES, "x" * 9000, RECORDING)


def test_the_room_is_used_to_the_last_byte() -> None:
    layout = SlotLayout((16, 16))
    slot = memoryview(bytearray(layout.slot_bytes))
    time = UtcNs((1 << 63) - 1)
    layout.complete(slot, b"x" * layout.most_tag_bytes, PulseNumber(1), time, time)
    with pytest.raises(ValueError, match="does not fit"):
        layout.complete(slot, b"x" * (layout.most_tag_bytes + 1), PulseNumber(1), time, time)
