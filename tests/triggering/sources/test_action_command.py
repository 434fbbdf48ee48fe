"""Action commands and acknowledges, byte by byte, and as the simulated camera reads them."""

import pytest

from rig.action import ActionKeys
from rig.clocks import DeviceNs, HostNs
from simrig.gige.protocol import gvcp
from triggering.sources.action_command import Acknowledge, ActionStatus, decode_acknowledge, encode_action

KEYS = ActionKeys(0x01020304, 0x0A0B0C0D, 0x80000001)


def test_a_command_for_at_once() -> None:
    assert encode_action(KEYS, 0x1122) == bytes.fromhex("42 01 0100 000c 1122  01020304 0a0b0c0d 80000001")


def test_a_scheduled_command() -> None:
    command = encode_action(KEYS, 1, DeviceNs(0x1112131415161718))
    assert command == bytes.fromhex("42 81 0100 0014 0001  01020304 0a0b0c0d 80000001 1112131415161718")


@pytest.mark.parametrize("time", [None, DeviceNs(1_795_216_434_399_239_000)])
def test_a_camera_reads_what_is_meant(time: DeviceNs | None) -> None:
    request = gvcp.parse(encode_action(KEYS, 77, time))
    assert (request.request_id, request.wants_ack) == (77, True)
    assert request.body == gvcp.Action(KEYS.device, KEYS.group, KEYS.mask, time)


@pytest.mark.parametrize(
    ("datagram", "found"),
    [
        ("0000 0101 0000 1122", Acknowledge(0x1122, ActionStatus.SUCCESS)),
        ("8013 0101 0000 0001", Acknowledge(1, ActionStatus.NO_REFERENCE_TIME)),
        ("8015 0101 0000 0001", Acknowledge(1, ActionStatus.OVERFLOW)),
        ("8016 0101 0000 ffff", Acknowledge(0xFFFF, ActionStatus.LATE)),
        ("8fff 0101 0000 0001", Acknowledge(1, 0x8FFF)),
        ("0000 0081 0000 0001", None),  # of a register
        ("0000 0101 0004 0001", None),  # cut off
        ("0000 0101 0000", None),
        ("", None),
    ],
)
def test_acknowledges(datagram: str, found: Acknowledge | None) -> None:
    assert decode_acknowledge(bytes.fromhex(datagram)) == found


def test_keys_differ_from_one_arming_to_the_next_and_are_never_none() -> None:
    assert ActionKeys.of(HostNs(7 << 32)).device == 1
    assert ActionKeys.of(HostNs(10**15)) == ActionKeys.of(HostNs(10**15)) != ActionKeys.of(HostNs(10**15 + 10**9))
