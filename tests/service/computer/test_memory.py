"""What a rig's buffers take is known before they are made, and must fit."""

import os
from contextlib import closing
from typing import Any

import pytest

from recorder.log.triplet_buffers import TripletBuffers
from rig.errors import BadInputError
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from service.processes.memory import check_memory, memory_needed, ring_slots
from tests.support.rigs import SIM

LARGE_MB = 1e9


def _with(**recorder: Any) -> RigSettings:
    return SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update=recorder)})


def test_it_is_what_the_buffers_really_take() -> None:
    needed = memory_needed(SIM, preroll_s=2.0)
    with closing(CameraRing.create("K1", SIM.cameras[0].frame_bytes, ring_slots(SIM))) as ring:
        size = os.fstat(ring.fd).st_size
    assert needed["recorder.ring_s"] == pytest.approx(3 * size, rel=0.02)
    slot = TripletBuffers(SIM.triplet_shape, 1).layout.slot_bytes
    assert needed["recorder.triplets_s"] == 60 * slot
    assert needed["recorder.preroll_limit_mb"] == 60 * slot
    check_memory(SIM, preroll_s=2.0)


@pytest.mark.parametrize(
    ("rig", "preroll_s", "key"),
    [
        (_with(ring_s=60.0, triplets_s=0.1), 0.0, "recorder.ring_s"),
        (_with(triplets_s=60.0), 0.0, "recorder.triplets_s"),
        (_with(preroll_limit_mb=LARGE_MB), 600.0, "recorder.preroll_limit_mb"),
    ],
)
def test_the_key_that_takes_most_is_named(rig: RigSettings, preroll_s: float, key: str) -> None:
    region = rig.cameras[0].region.model_copy(update={"width": 8192, "height": 8192})
    cameras = tuple(camera.model_copy(update={"region": region}) for camera in rig.cameras)
    with pytest.raises(BadInputError, match=rf"^the buffers of the rig need [\d.]+ GB .* lower {key}, which takes"):
        check_memory(rig.model_copy(update={"cameras": cameras}), preroll_s)
