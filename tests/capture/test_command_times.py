"""When a camera without a clock exposed: by the only command that can have made the frame."""

from capture.command_times import CommandTimes
from rig.clocks import NS_PER_S, DeviceNs, HostNs

MS = 1_000_000


def _times() -> CommandTimes:
    return CommandTimes(exposure_ns=2 * MS, longest_ns=3 * MS)


def test_a_frame_has_the_time_of_its_command() -> None:
    times = _times()
    times.sent(HostNs(10 * MS), HostNs(12 * MS))
    assert times.answered(HostNs(30 * MS)) == DeviceNs(11 * MS)
    assert times.latch(HostNs(40 * MS)).round_trip_ns == 2 * MS


def test_one_command_is_under_way_at_a_time_until_its_frame_can_no_longer_come() -> None:
    times = _times()
    assert times.is_free(HostNs(0))
    times.sent(HostNs(0), HostNs(MS))
    assert not times.is_free(HostNs(NS_PER_S))
    assert times.is_free(HostNs(NS_PER_S + 4 * MS))
    times.answered(HostNs(NS_PER_S))
    assert times.is_free(HostNs(NS_PER_S))


def test_a_frame_without_a_command_has_no_time_nor_one_whose_command_took_too_long() -> None:
    times = _times()
    assert times.answered(HostNs(0)) is None
    times.sent(HostNs(0), HostNs(4 * MS))
    assert times.answered(HostNs(5 * MS)) is None
    assert times.answered(HostNs(6 * MS)) is None


def test_what_it_costs_is_said_once_with_the_longest_delay_beyond_the_exposure() -> None:
    times = _times()
    said = []
    for pulse in range(20):
        times.sent(HostNs(pulse * NS_PER_S), HostNs(pulse * NS_PER_S + MS))
        times.answered(HostNs(pulse * NS_PER_S + (5 + pulse % 3) * MS))
        said.append(times.notice())
    (notice,) = filter(None, said)
    assert notice.endswith("exposed up to 5.0 ms later")
