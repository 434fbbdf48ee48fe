"""Bandwidth of FireWire buses: the figures of the standard, and rigs that do not fit."""

import pytest

from capture.iidc.bandwidth import UNITS_PER_BUS, check_bandwidth, need
from rig.errors import BadInputError
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings

GUID = "000a4701011b000"


def camera(number: int, **changes: object) -> CameraSettings:
    return CameraSettings.model_validate(
        {"name": f"K{number}", "backend": "iidc", "address": f"{GUID}{number}", **changes}
    )


def rig(*cameras: CameraSettings, rate_hz: float = 30.0) -> RigSettings:
    return RigSettings.model_validate({"name": "test", "cameras": cameras, "trigger": {"rate_hz": rate_hz}})


@pytest.mark.parametrize(
    ("rate_hz", "speed", "packet", "packets", "units"),
    [
        (30.0, 400, 1280, 240, 1292),
        (29.97, 400, 1280, 240, 1292),
        (30.1, 400, 1280, 240, 1292),
        (15.0, 400, 640, 480, 652),
        (7.5, 400, 320, 960, 332),
        (60.0, 400, 2560, 120, 2572),
        (30.0, 800, 1280, 240, 646),
        (30.0, 200, 1280, 240, 2584),
    ],
)
def test_640_x_480(rate_hz: float, speed: int, packet: int, packets: int, units: int) -> None:
    found = need(camera(1, iidc={"iso_speed": speed}), rate_hz)
    assert (found.packet_bytes, found.packets, found.units) == (packet, packets, units)


@pytest.mark.parametrize(
    ("region", "rate_hz", "packet", "packets", "units"),
    [((640, 480), 30.0, 2560, 240, 2572), ((640, 480), 15.0, 1280, 480, 1292), ((1024, 768), 15.0, 3072, 512, 3084)],
)
def test_16_bits_take_packets_twice_as_large(
    region: tuple[int, int], rate_hz: float, packet: int, packets: int, units: int
) -> None:
    """The tables of IIDC 1.31 (Format_0 Mode_6, Format_1 Mode_7), and the bus that is full with two at 30 Hz."""
    width, height = region
    deep = camera(1, pixel_format="Mono12", region={"width": width, "height": height})
    found = need(deep, rate_hz)
    assert (found.packet_bytes, found.packets, found.units) == (packet, packets, units)


def test_two_deep_cameras_at_30_hz_are_refused_and_three_at_15_hz_are_not() -> None:
    deep = [camera(number, pixel_format="Mono10") for number in (1, 2, 3)]
    check_bandwidth(rig(*deep, rate_hz=15.0))
    with pytest.raises(
        BadInputError, match=r"need 5144 of its 4915 .*, or set pixel_format = \"Mono8\", which needs half"
    ):
        check_bandwidth(rig(*deep[:2]))


def test_a_region_is_sent_within_the_period() -> None:
    found = need(camera(1, region={"x": 100, "y": 50, "width": 800, "height": 400}), 30.0, unit_bytes=4)
    assert found.packet_bytes % 4 == 0
    assert found.packet_bytes * found.packets >= 800 * 400
    assert 0.8e9 / 30 < found.transport_ns <= 0.9e9 / 30


def test_three_marlins_fit_and_a_fourth_does_not() -> None:
    three = [camera(number) for number in (1, 2, 3)]
    check_bandwidth(rig(*three))
    assert sum(need(one, 30.0).units for one in three) == 3876 < UNITS_PER_BUS
    with pytest.raises(BadInputError, match=r"bus 0 need 5168 of its 4915 bandwidth units \(K1 1292, .*K4 1292\)"):
        check_bandwidth(rig(*three, camera(4)))


def test_a_fourth_on_a_card_of_its_own_is_fine_and_so_is_half_the_rate() -> None:
    four = [camera(number) for number in (1, 2, 3, 4)]
    check_bandwidth(rig(*four, rate_hz=15.0))
    check_bandwidth(rig(*four[:3], camera(4, iidc={"bus": 1})))


def test_more_pulses_than_firewire_can_do() -> None:
    with pytest.raises(BadInputError, match=r"300 pulses per second are more than FireWire cameras can do"):
        check_bandwidth(rig(camera(1), rate_hz=300.0))
