"""Watches the newest images for a jumper, in a thread of its own."""

import threading
from collections.abc import Callable
from typing import Final

from rig.api.status import State
from rig.clocks import NS_PER_S, HostNs
from rig.frame import FrameStatus
from rig.settings.model import MotionSettings, RigSettings
from rig.transport.preview import PreviewImage, PreviewSlot
from service.aids import frame_of
from service.automatic.motion import MotionDetector

_POLL_S: Final = 0.03
#: After each look the recorder goes on copying images for this time.
_LEASE_S: Final = 3.0
#: After so long without an image of the camera its usual image is learned anew.
_MISSED_S: Final = 2.0


class MotionWatch:
    """Looks at the newest triplet again and again while armed; begun by `start`, ended by `close`.

    Args:
        rig: gives the rig in use.
        motion: which part of which camera's images.
        slot: shared memory with the newest triplet.
        state: the state of the service.
        seen: called with the host time of the image in which something moves, in the watching thread, also if `on` is
            false: then nothing begins, and somebody may have to be told.
    """

    def __init__(
        self,
        rig: Callable[[], RigSettings],
        motion: MotionSettings,
        slot: PreviewSlot,
        state: Callable[[], State],
        seen: Callable[[HostNs], None],
    ) -> None:
        self._slot, self._state, self._seen = slot, state, seen
        self._rig, self._part = rig, motion.region
        self._camera = [camera.name for camera in rig().cameras].index(motion.camera)
        self._detector = MotionDetector(motion.least_share)
        self._looked_at, self._pulse = HostNs(0), 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="motion watch")
        self.on = True

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.wait(_POLL_S):
            state = self._state()
            if state not in {State.ARMED, State.RECORDING}:
                continue
            self._slot.want(_LEASE_S)
            if self._slot.newest() not in {0, self._pulse} and (image := self._slot.read()) is not None:
                self._pulse = image.pulse
                # While a recording runs it goes on learning what is usual, and begins nothing.
                if self._moves(image) and state is State.ARMED:
                    self._seen(image.time)

    def _moves(self, image: PreviewImage) -> bool:
        rig = self._rig()
        if image.statuses[self._camera] is not FrameStatus.OK or image.pixels.shape != rig.triplet_shape:
            return False
        if image.time - self._looked_at > _MISSED_S * NS_PER_S:
            self._detector.forget()
        self._looked_at = image.time
        frame = frame_of(image.pixels, rig, self._camera)
        if (part := self._part) is not None:
            frame = frame[part.y : part.y + part.height, part.x : part.x + part.width]
        return self._detector.look(frame, image.time / NS_PER_S)
