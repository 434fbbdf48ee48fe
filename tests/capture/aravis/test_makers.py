"""Cameras of other makers: other features, other names, and settings that another program left behind."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import pytest

from capture.aravis.camera import AravisCamera
from capture.aravis.wire import Wire
from rig.clocks import NS_PER_S, host_now
from rig.errors import CameraError
from rig.frame import FrameRecord
from rig.settings.model import PacketDelay, RigSettings
from rig.transport.ring import CameraRing
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from simrig.gige.registers.makers import DIALECTS, Maker
from simrig.gige.registers.register_map import RegisterMap
from simrig.images import stamp
from tests.capture.rigs import SCENARIO, make_rig
from tests.support.loopback import Loopback

#: Settings that spoil a recording, and what they have to be: others may have left them as they are after a restart.
HARMLESS = {
    "TriggerMode": 1, "AcquisitionFrameRateEnable": 0, "ExposureAuto": 0, "GainAuto": 0, "GammaEnable": 0,
    "ReverseX": 0, "BinningHorizontal": 1, "BinningVertical": 1, "AcquisitionBurstFrameCount": 1, "TestPattern": 0,
    "TestImageSelector": 0, "TriggerOverlap": 1, "GainRaw": 0, "StreamBytesPerSecond": 124_000_000,
    "LineSelector": 0, "LineInverter": 0, "ShutterMode": 1, "StreamHoldEnable": 0,
}  # fmt: skip


class OnRig(Protocol):
    """A camera of a rig, and the ring for its frames."""

    rig: RigSettings
    ring: CameraRing


class Made:
    """A camera of a maker, in this process, and the rig to open it with."""

    def __init__(self, maker: Maker, rig: RigSettings, camera: Camera, ring: CameraRing) -> None:
        self.maker, self.rig, self.ring = maker, rig, ring
        self.camera = camera
        self.registers: RegisterMap = camera._device._registers

    @property
    def exposure_us(self) -> float:
        """By the feature of its description."""
        if "ExposureTime" in DIALECTS[self.maker].without:
            return self.registers.number("ExposureTimeRaw")
        return self.registers.real("ExposureTime")

    @contextmanager
    def opened(
        self, *, packet_delay: PacketDelay = "auto", wire: Wire | None = None, **settings: Any
    ) -> Iterator[AravisCamera]:
        """The camera, opened by the back end."""
        wanted = self.rig.cameras[0].model_copy(update={"trigger_input": self.input, **settings})
        network, period_ns = (
            self.rig.network.model_copy(update={"packet_delay": packet_delay}),
            self.rig.trigger.period_ns,
        )
        camera = AravisCamera(wanted, network, self.ring, period_ns, wire=wire or Wire())
        try:
            yield camera
        finally:
            camera.close()

    @property
    def input(self) -> str:
        """The input that the pulses come in at."""
        return DIALECTS[self.maker].entries.get("TriggerSource", ("Line0",))[0].replace("Any", "Line0")


@pytest.fixture
def made(request: pytest.FixtureRequest, tmp_path: Path, loopback: Loopback) -> Iterator[Made]:
    with make(request.param, tmp_path, loopback) as made:
        yield made


@contextmanager
def make(maker: Maker, tmp_path: Path, loopback: Loopback, **options: Any) -> Iterator[Made]:
    rig = make_rig(tmp_path, "aravis", loopback, names=["K2"])
    config = CameraConfig(
        name="K2", address=rig.cameras[0].address, scenario=SCENARIO, rate_hz=rig.trigger.rate_hz, epoch=host_now(),
        test_pattern=True, ptp_offset_ns=0, maker=maker, **options,
    )  # fmt: skip
    camera, ring = Camera(config), CameraRing.create("K2", rig.cameras[0].frame_bytes, 16)
    camera.start()
    try:
        yield Made(maker, rig, camera, ring)
    finally:
        camera.stop()
        ring.close()


@pytest.mark.parametrize("made", Maker, indirect=True)
def test_a_camera_of_any_maker_takes_one_frame_per_pulse_as_the_rig_file_says(made: Made) -> None:
    with made.opened() as camera:
        registers = made.registers
        assert {name: registers.number(name) for name in HARMLESS if name in registers} == {
            name: value for name, value in HARMLESS.items() if name in registers
        }
        assert made.exposure_us == made.rig.cameras[0].exposure_us
        selectors = DIALECTS[made.maker].entries.get("TriggerSelector", ("FrameStart",))
        assert selectors[registers.number("TriggerSelector")] in {"FrameStart", "FrameBurstStart", "ExposureStart"}
        camera.start()
        pulses, times = frames_of(camera, made, 6)
        assert pulses == list(range(pulses[0], pulses[0] + 6))
        assert camera.counters()["temperature_mdeg"] > 0
        latch = camera.latch()
        assert latch.device > times[-1]
        periods = [(after - before) * made.rig.trigger.rate_hz / NS_PER_S for before, after in pairwise(times)]
        assert periods == pytest.approx([1.0] * 5, abs=0.02)


def frames_of(camera: AravisCamera, made: OnRig, count: int) -> tuple[list[int], list[int]]:
    """Pulses of the next frames, as their pixels name them, without a gap, and their times by the camera's clock."""
    region, deadline = made.rig.cameras[0].region, host_now() + 20 * NS_PER_S
    pulses, times = list[int](), list[int]()
    while len(pulses) < count:
        assert host_now() < deadline
        arrival = camera.receive(0.2)
        if not isinstance(arrival, FrameRecord):
            pulses, times = [], []  # a busy machine lost one: begin again
            continue
        read = stamp.read(made.ring.frame(arrival.slot).reshape(region.height, region.width))
        made.ring.return_slot(arrival.slot)
        assert read is not None
        pulses.append(read.pulse)
        times.append(arrival.device_time)
    return pulses, times


@pytest.mark.parametrize(
    ("made", "settings", "told"),
    [
        (
            Maker.BASLER,
            {"trigger_input": "Line0"},
            'has no trigger input "Line0" (it has Line1, Line3, Software, Action1)',
        ),
        (
            Maker.HIKROBOT,
            {"pixel_format": "Mono10p"},
            "has no pixel format Mono10p (it has Mono8, Mono10, Mono12, ",
        ),
        (
            Maker.JAI_LINES,
            {"trigger_input": "Line7"},
            'has no trigger input "Line7" (it has Line4, Line5, SoftwareTrigger0, Action1)',
        ),
    ],
    indirect=["made"],
)
def test_what_would_make_a_recording_wrong_is_refused_with_what_the_camera_has(
    made: Made, settings: dict[str, Any], told: str
) -> None:
    with pytest.raises(CameraError) as refused, made.opened(**settings):
        pass
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("made", "settings", "steps"),
    [
        (Maker.BASLER, {"gain_raw": 33}, 33),
        (Maker.BASLER, {"gain_db": 6.0, "gain_step_db": 0.0359}, 167),
        (Maker.PROSILICA, {"gain_db": 6.0, "gain_step_db": 1.0}, 6),
    ],
    indirect=["made"],
)
def test_gain_in_steps_alone_is_set_in_steps_or_by_what_a_step_is(
    made: Made, settings: dict[str, Any], steps: int
) -> None:
    with made.opened(**settings) as camera:
        assert not [notice for notice in camera.notices() if "ain" in notice]
        assert made.registers.number("GainRaw") == steps


def test_a_camera_whose_exposure_mode_is_unknown_is_refused_with_what_is_true(
    tmp_path: Path, loopback: Loopback, monkeypatch: pytest.MonkeyPatch
) -> None:
    dialect = DIALECTS[Maker.JAI_LINES]
    modes = {**dialect.entries, "TriggerMode": ("Continuous", "PulseWidthControl")}
    monkeypatch.setitem(DIALECTS, Maker.JAI_LINES, replace(dialect, entries=modes))
    told = "it has no TriggerMode, and its ExposureMode has Continuous, PulseWidthControl, none of which is known here"
    with make(Maker.JAI_LINES, tmp_path, loopback) as made, pytest.raises(CameraError, match=told), made.opened():
        pass


@pytest.mark.parametrize(
    ("made", "settings", "told"),
    [
        (Maker.JAI, {"trigger_edge": "falling"}, ["the edge of the pulse cannot be chosen"]),
        (
            Maker.HIKROBOT,
            {"exposure_us": 2e6},
            ["input waits 50 us for a steady level", "it exposes 1e+06 us, not 2e+06"],
        ),
        (Maker.BASLER, {"gain_db": 6.0}, ["input waits 10 us", "its gain has no unit (GainRaw, 0 to 500)"]),
        (Maker.BASLER, {"gain_raw": 501}, ["input waits 10 us", "its GainRaw is 500, not 501 (it takes 0 to 500)"]),
        (Maker.STANDARD, {"gain_raw": 5}, ["it has no gain in steps, so gain_raw sets nothing: use gain_db"]),
    ],
    indirect=["made"],
)
def test_what_cannot_be_set_is_said_with_what_it_costs(made: Made, settings: dict[str, Any], told: list[str]) -> None:
    with made.opened(**settings) as camera:
        notices = camera.notices()
    assert len(notices) == len(told)
    for notice, words in zip(notices, told, strict=True):
        assert words in notice
