"""The memory that the buffers of a rig take, and whether this computer has it."""

from collections.abc import Mapping
from typing import Final

from recorder.live.assembler import in_flight_triplets
from recorder.live.preroll import preroll_triplets
from recorder.log.mcap_layout import SlotLayout
from rig.errors import BadInputError
from rig.memory import available_bytes
from rig.settings.model import RigSettings
from rig.transport.ring import MAX_SLOTS

_LEAST_SLOTS: Final = 16
_GB: Final = 1e9


def ring_slots(rig: RigSettings) -> int:
    """Number of frames in each camera's ring."""
    wanted = round(rig.recorder.ring_s * rig.trigger.rate_hz)
    return min(MAX_SLOTS, max(_LEAST_SLOTS, wanted))


def memory_needed(rig: RigSettings, preroll_s: float) -> Mapping[str, int]:
    """Bytes of the buffers, by the key of the rig file that decides on them."""
    slot_bytes = SlotLayout(rig.triplet_shape, rig.own_topics()).slot_bytes
    return {
        "recorder.ring_s": sum(camera.frame_bytes for camera in rig.cameras) * ring_slots(rig),
        "recorder.triplets_s": in_flight_triplets(rig) * slot_bytes,
        "recorder.preroll_limit_mb": preroll_triplets(rig, preroll_s, slot_bytes) * slot_bytes,
    }


def check_memory(rig: RigSettings, preroll_s: float) -> None:
    """Check that the buffers fit into the memory that is available.

    Raises:
        BadInputError: they do not; the message names the key that takes most.
    """
    needed, available = memory_needed(rig, preroll_s), available_bytes()
    if (total := sum(needed.values())) <= available:
        return
    largest = max(needed, key=lambda key: needed[key])
    raise BadInputError(
        f"the buffers of the rig need {total / _GB:.1f} GB of memory and {available / _GB:.1f} GB are available: lower "
        f"{largest}, which takes {needed[largest] / _GB:.1f} GB, or the cameras' regions"
    )
