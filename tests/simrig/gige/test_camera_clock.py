"""The camera's timestamps."""

import pytest

from rig.clocks import NS_PER_S, HostNs
from rig.pulse import HillPulse
from rig.settings.file import CONFIG
from simrig.gige.imaging.camera_clock import PTP_SETTLE_NS, CameraClock, PtpMaster
from simrig.gige.registers.register_table import PtpStatus
from simrig.world.pulses import DeviceClock
from simrig.world.scenario import load_scenario

EPOCH = HostNs(5 * NS_PER_S)
MASTER = PtpMaster(offset_ns=1_000_000_000_000, error_ns=-120)


@pytest.fixture(scope="module")
def free() -> DeviceClock:
    scenario = load_scenario(CONFIG / "scenarios" / "training.toml")
    camera = scenario.cameras[0].model_copy(update={"offset_s": 7.0, "drift_ppm": 50.0, "exposure_jitter_us": 3.0})
    return DeviceClock(scenario.model_copy(update={"cameras": (camera,)}), 0, EPOCH)


def test_the_free_clock_is_the_scenarios(free: DeviceClock) -> None:
    clock = CameraClock(free, MASTER, NS_PER_S)
    later = HostNs(EPOCH + 100 * NS_PER_S)
    assert clock.ticks(later) == free.at(later)
    assert clock.ticks(later) - clock.ticks(EPOCH) == 100 * NS_PER_S + 5_000_000
    assert clock.exposure_ticks(later, HillPulse(3)) == free.at_pulse(later, HillPulse(3)) != free.at(later)


def test_ticks_of_another_length(free: DeviceClock) -> None:
    clock = CameraClock(free, MASTER, 125_000_000)
    assert clock.ticks(EPOCH) == free.at(EPOCH) // 8


def test_reset_starts_from_0(free: DeviceClock) -> None:
    clock = CameraClock(free, MASTER, NS_PER_S)
    clock.reset(EPOCH)
    assert clock.ticks(EPOCH) == 0
    assert clock.ticks(HostNs(EPOCH + NS_PER_S)) == NS_PER_S + 50_000


def test_ptp_settles_onto_the_masters_time(free: DeviceClock) -> None:
    clock = CameraClock(free, MASTER, NS_PER_S)
    settled = HostNs(EPOCH + PTP_SETTLE_NS)
    assert clock.ptp_status(EPOCH) is PtpStatus.DISABLED
    clock.enable_ptp(True, EPOCH)
    clock.enable_ptp(True, HostNs(EPOCH + 1))
    assert clock.ptp_status(HostNs(settled - 1)) is PtpStatus.UNCALIBRATED
    assert clock.ticks(HostNs(settled - 1)) == free.at(HostNs(settled - 1))
    assert clock.ptp_offset_ns(HostNs(settled - 1)) == 0
    assert clock.ptp_status(settled) is PtpStatus.SLAVE
    assert clock.ticks(settled) == settled + MASTER.offset_ns + MASTER.error_ns
    assert clock.ptp_offset_ns(settled) == MASTER.error_ns
    assert clock.host_of(clock.ticks(settled)) == settled
    clock.enable_ptp(False, settled)
    assert clock.ptp_status(settled) is PtpStatus.DISABLED
    assert clock.ticks(settled) == free.at(settled)
