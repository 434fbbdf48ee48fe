"""A simulated GigE Vision camera, opened by the back end through the real Aravis."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from capture.aravis.camera import AravisCamera
from capture.seam import Arrival
from rig.clocks import host_now
from rig.frame import FrameRecord
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from service.processes.simulation import simulated_hill
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from simrig.images import stamp
from tests.capture.rigs import SCENARIO, make_rig
from tests.support.loopback import Loopback

_PATIENCE_NS = 20_000_000_000


class OneCamera:
    """The rig of one camera, K2, and its ring.

    Attributes:
        rig: its settings.
        ring: where the frames go.
    """

    def __init__(self, rig: RigSettings, ring: CameraRing) -> None:
        self.rig, self.ring = rig, ring

    @property
    def address(self) -> str:
        """Of the camera."""
        return self.rig.cameras[0].address

    def open(self) -> AravisCamera:
        """Connect and configure."""
        return AravisCamera(self.rig.cameras[0], self.rig.network, self.ring, self.rig.trigger.period_ns)

    @contextmanager
    def opened(self) -> Iterator[AravisCamera]:
        """The camera, streaming; its first frames have come."""
        camera = self.open()
        try:
            camera.start()
            self.frames(camera, 3)
            yield camera
        finally:
            camera.close()

    def frames(self, camera: AravisCamera, count: int) -> list[tuple[Arrival, int]]:
        """The next `count` arrivals, each with the pulse that its pixels name (-1 if it is damaged)."""
        found: list[tuple[Arrival, int]] = []
        deadline = host_now() + _PATIENCE_NS
        while len(found) < count:
            assert host_now() < deadline, f"only {len(found)} of {count} frames came"
            if (arrival := camera.receive(0.2)) is not None:
                found.append((arrival, self._pulse(arrival) if isinstance(arrival, FrameRecord) else -1))
        return found

    def _pulse(self, arrival: FrameRecord) -> int:
        region = self.rig.cameras[0].region
        read = stamp.read(self.ring.frame(arrival.slot).reshape(region.height, region.width))
        assert read is not None, "the frame is not the camera's"
        self.ring.return_slot(arrival.slot)
        return read.pulse


@contextmanager
def one_camera(
    folder: Path, loopback: Loopback, *, named_port: int | None = None, **options: Any
) -> Iterator[OneCamera]:
    """A simulated camera that is triggered at 30 Hz.

    Args:
        folder: where the rig file goes.
        loopback: addresses.
        named_port: the port from which the camera says that it streams; None: the one from which it does.
        options: as for `tests.capture.rigs.make_rig`.
    """
    rig = make_rig(folder, "aravis", loopback, names=["K2"], **options)
    ring = CameraRing.create("K2", rig.cameras[0].frame_bytes, 16)
    hill = simulated_hill(rig, host_now()) if named_port is None else _lying(rig, named_port)
    try:
        with hill:
            yield OneCamera(rig, ring)
    finally:
        ring.close()


@contextmanager
def _lying(rig: RigSettings, named_port: int) -> Iterator[None]:
    """The camera in this process, with another source port in its register than it streams from."""
    config = CameraConfig(
        name="K2", address=rig.cameras[0].address, scenario=SCENARIO, rate_hz=rig.trigger.rate_hz, epoch=host_now(),
        test_pattern=True, ptp_offset_ns=0,
    )  # fmt: skip
    camera = Camera(config)
    camera._device._registers.set("GevSCSP", named_port)
    camera.start()
    try:
        yield
    finally:
        camera.stop()
