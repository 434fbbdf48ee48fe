"""Who may control a camera, and for how long."""

import pytest

from rig.clocks import HostNs
from simrig.gige.control.control_channel import CONTROL, EXCLUSIVE, ControlChannel
from simrig.gige.registers.register_map import RegisterError

ANNA, BERT = ("127.0.0.1", 1000), ("127.0.0.1", 2000)


def test_the_first_one_gets_control_and_the_second_is_refused() -> None:
    channel = ControlChannel()
    channel.claim(ANNA, CONTROL, HostNs(0))
    with pytest.raises(RegisterError):
        channel.claim(BERT, CONTROL, HostNs(1))
    channel.check_write(ANNA)
    channel.check_read(BERT)
    with pytest.raises(RegisterError):
        channel.check_write(BERT)


def test_nobody_writes_without_control() -> None:
    with pytest.raises(RegisterError):
        ControlChannel().check_write(ANNA)


def test_exclusive_access_keeps_readers_out() -> None:
    channel = ControlChannel()
    channel.claim(ANNA, EXCLUSIVE | CONTROL, HostNs(0))
    channel.check_read(ANNA)
    with pytest.raises(RegisterError):
        channel.check_read(BERT)


def test_control_can_be_handed_back() -> None:
    channel = ControlChannel()
    channel.claim(ANNA, CONTROL, HostNs(0))
    channel.claim(ANNA, 0, HostNs(1))
    assert channel.silent_at(100) is None
    channel.claim(BERT, CONTROL, HostNs(2))
    assert channel.controller == BERT


def test_only_the_controllers_commands_are_heartbeats() -> None:
    channel = ControlChannel()
    channel.claim(ANNA, CONTROL, HostNs(10))
    assert channel.silent_at(100) == 110
    channel.heard(BERT, HostNs(50))
    assert channel.silent_at(100) == 110
    channel.heard(ANNA, HostNs(60))
    assert channel.silent_at(100) == 160
    channel.release()
    assert channel.controller is None
    assert channel.silent_at(100) is None
