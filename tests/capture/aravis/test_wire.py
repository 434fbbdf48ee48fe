"""Cameras that share a port leave time between their packets, by whichever feature they have."""

from dataclasses import replace
from pathlib import Path

import pytest

from capture.aravis.wire import Wire
from rig.errors import CameraError
from rig.pulse import HillPulse
from rig.settings.model import PacketDelay
from simrig.gige.registers.makers import DIALECTS, Maker
from tests.capture.aravis.test_makers import frames_of, make
from tests.support.loopback import Loopback

THREE = Wire(cameras=3, mbit_s=1000)
#: Of VGA, 8 bits, in packets of 9000 bytes: 35 with leader and trailer 37, 72.304 us each.
PACKETS, PACKET_US = 37, 72.304


@pytest.mark.parametrize(
    ("maker", "register", "value"),
    [
        (Maker.STANDARD, "GevSCPD", 144_608),
        (Maker.FLIR, "GevSCPD", 144_608),
        (Maker.ALLIED_VISION, "StreamBytesPerSecond", 41_491_480),
        (Maker.BASLER_ACE_2, "DeviceLinkThroughputLimit", 41_491_480),
    ],
)
def test_three_cameras_at_one_port_each_leave_two_thirds_of_the_time_to_the_others(
    tmp_path: Path, loopback: Loopback, maker: Maker, register: str, value: int
) -> None:
    with make(maker, tmp_path, loopback) as made, made.opened(wire=THREE) as camera:
        assert made.registers.number(register) == pytest.approx(value, rel=1e-4)
        assert camera.description.endswith(", 8.0 ms to send a frame")
        assert not [notice for notice in camera.notices() if "packets" in notice]
        camera.start()
        pulses, _ = frames_of(camera, made, 3)
        pulse = HillPulse(pulses[-2])  # of the last one the camera may not have noted yet that it is sent
        sent = made.camera.statistics().last_packets[pulse] - made.camera._sensor._train.time(pulse)
        assert sent > (PACKETS - 2) * 3 * PACKET_US * 1000


@pytest.mark.parametrize(
    ("maker", "told", "most_ms"),
    [(Maker.STANDARD, "GevSCPD", 77.2), (Maker.ALLIED_VISION, "StreamBytesPerSecond", 111.0)],
)
def test_what_another_program_left_is_kept_if_that_is_asked_for_and_told_if_it_is_too_slow(
    tmp_path: Path, loopback: Loopback, maker: Maker, told: str, most_ms: float
) -> None:
    with make(maker, tmp_path, loopback) as made:
        if maker is Maker.STANDARD:
            made.registers.set("GevSCPD", 2_014_000)
        with pytest.raises(CameraError) as refused, made.opened(packet_delay="keep", wire=THREE):
            pass
    assert str(refused.value) == (
        f"camera K2 needs {most_ms} ms to send a frame ({told}), and pulses come every 33.3 ms: "
        'set network.packet_delay = "auto" in the rig file'
    )


@pytest.mark.parametrize(("wanted", "ticks"), [(100, 100_000), (12.5, 12_500), ("auto", 0)])
def test_a_delay_in_microseconds_or_none_for_a_camera_alone(
    tmp_path: Path, loopback: Loopback, wanted: PacketDelay, ticks: int
) -> None:
    with make(Maker.STANDARD, tmp_path, loopback) as made:
        made.registers.set("GevSCPD", 555)
        with made.opened(packet_delay=wanted, wire=Wire(1, 1000)):
            assert made.registers.number("GevSCPD") == ticks


def test_a_delay_is_in_ticks_of_the_clock_also_where_the_description_does_not_tell_them(
    tmp_path: Path, loopback: Loopback, monkeypatch: pytest.MonkeyPatch
) -> None:
    dialect = replace(DIALECTS[Maker.STANDARD], without=frozenset({"GevTimestampTickFrequency"}))
    monkeypatch.setitem(DIALECTS, Maker.STANDARD, dialect)
    with make(Maker.STANDARD, tmp_path, loopback, tick_hz=125_000_000) as made, made.opened(wire=THREE) as camera:
        assert made.registers.number("GevSCPD") == 18_076
        assert camera.description.endswith(", 8.0 ms to send a frame")


def test_a_frame_that_the_port_cannot_carry_from_pulse_to_pulse_is_refused(tmp_path: Path, loopback: Loopback) -> None:
    told = r"needs 267.5 ms to send a frame \(speed of the port\), and pulses come every 33.3 ms: choose a smaller"
    with (
        make(Maker.STANDARD, tmp_path, loopback) as made,
        pytest.raises(CameraError, match=told),
        made.opened(wire=Wire(1, 10)),
    ):
        pass


@pytest.mark.parametrize(
    ("refuses", "ticks", "told"), [(False, 144_608, []), (True, 0, ["its packets follow each other"])]
)
def test_a_camera_whose_description_has_no_way_is_asked_for_the_register_of_the_standard(
    tmp_path: Path, loopback: Loopback, monkeypatch: pytest.MonkeyPatch, refuses: bool, ticks: int, told: list[str]
) -> None:
    if refuses:
        dialect = replace(DIALECTS[Maker.PROSILICA], read_only=frozenset({"GevSCPD"}))
        monkeypatch.setitem(DIALECTS, Maker.PROSILICA, dialect)
    with make(Maker.PROSILICA, tmp_path, loopback) as made, made.opened(wire=THREE) as camera:
        assert made.registers.number("GevSCPD") == ticks
        notices = [notice for notice in camera.notices() if "packets" in notice]
        assert len(notices) == len(told)
        assert all(words in notice for words, notice in zip(told, notices, strict=True))


def test_delays_leave_a_fifth_of_the_period_for_packets_that_are_sent_again(tmp_path: Path, loopback: Loopback) -> None:
    with make(Maker.STANDARD, tmp_path, loopback) as made, made.opened(wire=Wire(20, 1000)) as camera:
        assert camera.description.endswith(", 26.7 ms to send a frame")


def test_the_port_of_a_camera_is_that_of_its_route() -> None:
    assert Wire.to("127.0.0.11", ["127.0.0.11", "127.0.0.12", "255.255.255.255"]) == Wire(2, None)
    assert Wire.to("255.255.255.256", ["255.255.255.256"]) == Wire()
