"""A simulated camera with the description of another one, through the real Aravis.

Its registers are memory, so first they are filled as a maker would: what the description says may be missing is there,
enumerations have one of their values, the sensor has 640 x 480 px. What was set up is read out again by a second
connection, and the simulated sensor obeys that.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import gi

from capture.aravis.camera import AravisCamera
from capture.aravis.features import Features
from rig.clocks import HostNs, host_now
from rig.images.pixels import FORMATS
from rig.settings.model import PacketDelay, RigSettings
from rig.settings.trigger import ExternalTrigger, Trigger
from rig.transport.ring import CameraRing
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from simrig.gige.registers.described_map import DescribedMap
from tests.capture.rigs import SCENARIO, make_rig
from tests.support.loopback import Loopback

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis, GLib  # noqa: E402  (the version must be required first)

#: Time of a pulse, by which the keys of action commands are made.
ORIGIN: Final = HostNs(0x12345678)
_ONES: Final = 0xFFFFFFFF
_LARGE: Final = 1_000_000
_NUMBERS: Final = {
    "SensorWidth": 640, "WidthMax": 640, "Width": 640, "SensorHeight": 480, "HeightMax": 480, "Height": 480,
    "OffsetX": 0, "OffsetY": 0, "BinningHorizontal": 1, "BinningVertical": 1, "DecimationHorizontal": 1,
    "DecimationVertical": 1, "PayloadSize": 640 * 480,
}  # fmt: skip
#: Features that are made available: all that a set-up asks for, by any name.
_WANTED: Final = re.compile(
    r"(Trigger|Line|Exposure|Gain|Acquisition|Action|Ptp|GevIEEE|PixelFormat|Width|Height|Offset|Sensor|Payload|GevSCP|Stream)"
)
_FREE, _TRIGGERED = 0, 1


def descriptions(folder: Path) -> list[Path]:
    """The descriptions in a folder, by name."""
    return sorted(folder.glob("*.xml"))


class Described:
    """A camera of this process with a description of others, and the rig to open it with."""

    def __init__(self, rig: RigSettings, camera: Camera, ring: CameraRing, input_name: str) -> None:
        self.rig, self.ring, self.input = rig, ring, input_name
        self._camera = camera

    @contextmanager
    def opened(
        self,
        *,
        packet_size: int | None = None,
        packet_delay: PacketDelay = "auto",
        set_back: bool = False,
        trigger: Trigger | None = None,
        **settings: Any,
    ) -> Iterator[AravisCamera]:
        """The camera, opened by the back end; by a cable, unless another trigger is named."""
        wanted = self.rig.cameras[0].model_copy(update={"trigger_input": self.input, **settings})
        size = packet_size or self.rig.network.packet_size
        network = self.rig.network.model_copy(update={"packet_size": size, "packet_delay": packet_delay})
        by, period_ns = trigger or ExternalTrigger(), self.rig.trigger.period_ns
        camera = AravisCamera(wanted, network, self.ring, period_ns, by, ORIGIN, set_back=set_back)
        try:
            yield camera
        finally:
            camera.close()

    def leave(self, values: Sequence[tuple[str, str | float]]) -> None:
        """What another program or the maker has left, feature by feature; an enumeration's value by its name."""
        registers = self._registers
        registers.made = False
        with _controlled(self.rig.cameras[0].address) as device:
            filling = _Filling(device, ET.Element("none"))
            for name, value in values:
                if isinstance(value, str):
                    device.set_string_feature_value(name, value)
                else:
                    filling.set(name, value)
        registers.made = True

    def has(self, name: str) -> bool:
        """Whether its description has a feature of this name."""
        return f'Name="{name}"' in next(iter(self._registers._documents.values())).decode()

    def lock(self, address: int, switch: int) -> None:
        """Have the camera refuse to have an address written while there is 0 at another."""
        registers = self._registers
        registers.refuses = lambda place: place == address and not any(registers.read(switch, 4))

    def memory(self) -> dict[int, bytes]:
        """All registers but those of the standard, by address; 0 stands where nothing was ever written."""
        return {address: data for address, data in self._registers._others.items() if any(data)}

    @property
    def _registers(self) -> DescribedMap:
        registers = self._camera._device._registers
        assert isinstance(registers, DescribedMap)
        return registers

    def start(self, camera: AravisCamera) -> None:
        """Start, and have the simulated sensor obey what the registers say now."""
        device = self._camera._device
        device._registers.set("TriggerMode", _TRIGGERED if self._is_triggered(camera._features) else _FREE)
        camera.start()
        device._start_acquisition()

    def _is_triggered(self, features: Features) -> bool:
        if features.has("TriggerMode"):
            source = features.chosen("TriggerSource")
            frame = features.chosen("TriggerSelector") in {None, "FrameStart", "FrameBurstStart", "ExposureStart"}
            return features.chosen("TriggerMode") == "On" and source in {None, self.input, "Any"} and frame
        return features.chosen("ExposureMode") == "EdgePreSelect" and features.chosen("LineSource") == self.input


@contextmanager
def described(path: Path, folder: Path, loopback: Loopback) -> Iterator[Described]:
    """A camera with the description at `path`, as its maker would have made it."""
    rig = make_rig(folder, "aravis", loopback, names=["K2"])
    config = CameraConfig(
        name="K2", address=rig.cameras[0].address, scenario=SCENARIO, rate_hz=rig.trigger.rate_hz, epoch=host_now(),
        test_pattern=True, ptp_offset_ns=0, description=path,
    )  # fmt: skip
    camera = Camera(config)
    camera.start()
    try:
        source, pixels = _make(rig.cameras[0].address, ET.parse(path).getroot())  # noqa: S314 - one's own file
        registers = camera._device._registers
        assert isinstance(registers, DescribedMap)
        registers.made = True
        settings = rig.cameras[0].model_copy(update={"pixel_format": pixels})
        ring = CameraRing.create("K2", settings.frame_bytes, 16)
        try:
            yield Described(rig.model_copy(update={"cameras": (settings,)}), camera, ring, source)
        finally:
            ring.close()
    finally:
        camera.stop()


def _make(address: str, description: ET.Element) -> tuple[str, str]:
    """Fill the registers; names of an input and of a pixel format that the camera has then."""
    with _controlled(address) as device:
        return _Filling(device, description).run()


@contextmanager
def _controlled(address: str) -> Iterator[Any]:
    """The camera, of which nothing is checked that is written."""
    device = Aravis.Camera.new(address).get_device()
    device.set_range_check_policy(Aravis.RangeCheckPolicy.DISABLE)
    device.set_access_check_policy(Aravis.AccessCheckPolicy.DISABLE)
    try:
        yield device
    finally:
        device.leave_control()


class _Filling:
    """Fills the registers of a camera by its own description."""

    def __init__(self, device: Any, description: ET.Element) -> None:
        self._device, self._features = device, Features(device)
        self._nodes = {name: each for each in description.iter() if (name := each.get("Name"))}

    def run(self) -> tuple[str, str]:
        names = [name for name in self._nodes if _WANTED.match(name) and self._is_feature(name)]
        for name in names:
            self._allow(self._nodes[name], name)
        for name, value in _NUMBERS.items():
            self.set(name, value)
        for name in names:
            if _kind(self._nodes[name]) == "Enumeration":
                self._choose(name)
            elif (bounds := self._features.bounds(name)) is not None and bounds[0] >= bounds[1]:
                self._widen(name)
        for name, value in _NUMBERS.items():
            self.set(name, value)
        formats = self._features.entries("PixelFormat")
        eight_bits = [each for each in formats if each in FORMATS and FORMATS[each].frame_bytes(8, 1) == 8]
        return self._input(), "Mono8" if "Mono8" in eight_bits or not eight_bits else eight_bits[0]

    def _input(self) -> str:
        sources = self._features.entries("TriggerSource" if "TriggerMode" in self._nodes else "LineSource")
        return next((each for each in sources if each.startswith("Line")), sources[0] if sources else "Line0")

    def _is_feature(self, name: str) -> bool:
        return isinstance(self._device.get_feature(name), Aravis.GcFeatureNode)

    def set(self, name: str, value: float) -> None:
        """Write a node by its kind, as far as it can be written."""
        with suppress(GLib.Error):
            node = self._device.get_feature(name)
            if isinstance(node, Aravis.GcFloat):
                self._device.set_float_feature_value(name, float(value))
            elif isinstance(node, Aravis.GcBoolean):
                self._device.set_boolean_feature_value(name, bool(value))
            elif isinstance(node, Aravis.GcInteger) and self._features.number(name) != value:
                self._device.set_integer_feature_value(name, int(value))

    def _allow(self, element: ET.Element, name: str) -> None:
        """Make what decides whether a feature or a value is there, and not locked, say so."""
        for child in element:
            kind, target = _kind(child), (child.text or "").strip()
            if kind in {"pIsImplemented", "pIsAvailable"}:
                self._turn(target, lambda: bool(self._device.is_feature_available(name)), (1, _ONES))
            elif kind == "pIsLocked":
                self.set(target, 0)

    def _turn(self, target: str, done: Any, values: tuple[int, ...]) -> None:
        """Write a node, or those that its formula is made of, until it says what it should."""
        element = self._nodes.get(target)
        if element is None:
            return
        variables = [(each.text or "").strip() for each in element if _kind(each) == "pVariable"]
        for value in values:
            with suppress(GLib.Error):
                if done():
                    return
            for each in variables or [target]:
                self.set(each, value)

    def _choose(self, name: str) -> None:
        """Give an enumeration one of its values, unless it has one."""
        entries = [each for each in self._nodes[name] if _kind(each) == "EnumEntry"]
        for entry in entries:
            for child in entry:
                if _kind(child) in {"pIsImplemented", "pIsAvailable"}:
                    self._turn((child.text or "").strip(), lambda: False, (1,))
        there = self._features.entries(name)
        if self._features.chosen(name) not in there and there:
            with suppress(GLib.Error):
                self._device.set_string_feature_value(name, there[0])

    def _widen(self, name: str) -> None:
        for child in self._nodes[name]:
            if _kind(child) == "pMax":
                self.set((child.text or "").strip(), _LARGE)


def _kind(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]
