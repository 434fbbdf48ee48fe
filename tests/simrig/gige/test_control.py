"""The control channel: privilege, heartbeat, clock, actions, discovery; with Aravis and with bare packets."""

import os
import socket
import struct

import gi
import pytest

from rig.clocks import HostNs, host_now
from simrig.gige.protocol.gvcp import PORT, Command, Status
from tests.simrig.gige.conftest import MakeCamera, SimulatedCamera
from tests.simrig.gige.raw_client import CCP, PENDING_ACK, GvcpClient
from tests.simrig.gige.receiver import Receiver
from tests.support.waiting import wait_until

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis, GLib  # noqa: E402

CONTROL, EXCLUSIVE = 2, 1
HEARTBEAT_TIMEOUT, SCP, SCDA, SCPS = 0x0938, 0x0D00, 0x0D18, 0x0D04
TIMESTAMP_CONTROL, TIMESTAMP_HIGH, TIMESTAMP_LOW = 0x0944, 0x0948, 0x094C


def action_receiver(simulated: SimulatedCamera) -> Receiver:
    """Waits for actions; its small region is read out before it is sent, so that the sensor is ready again."""
    return Receiver(
        simulated.address, trigger="Action0", exposure_us=10.0, region=(0, 0, 320, 16),
        ActionDeviceKey=0x1234, ActionGroupKey=0x56, ActionGroupMask=0x3,
    )  # fmt: skip


def test_a_second_controller_is_refused(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as first, GvcpClient(simulated.address) as second:
        assert first.device.is_controller()
        assert second.write(CCP, CONTROL) == Status.ACCESS_DENIED
        assert second.write(HEARTBEAT_TIMEOUT, 1000) == Status.ACCESS_DENIED
        assert second.read(HEARTBEAT_TIMEOUT) == 3000
        third = Aravis.Camera.new(simulated.address)
        assert not third.get_device().is_controller()
        with pytest.raises(GLib.Error, match="access-denied"):
            third.get_device().set_float_feature_value("ExposureTime", 50.0)
        del third
        assert len(first.frames(5)) == 5, "the first one is not disturbed"


def test_exclusive_access(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with GvcpClient(simulated.address) as first, GvcpClient(simulated.address) as second:
        assert first.write(CCP, EXCLUSIVE) == 0
        assert second.ask(Command.READREG, struct.pack(">I", CCP)).status == Status.ACCESS_DENIED
        assert second.ask(Command.READMEM, struct.pack(">IHH", 0, 0, 8)).status == Status.ACCESS_DENIED
        assert second.ask(Command.DISCOVERY).status == 0, "anybody may look for cameras"
        assert first.write(CCP, 0) == 0
        assert second.read(CCP) == 0


def test_silence_costs_the_control_and_closes_the_stream(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    receiver = Receiver(simulated.address, GevHeartbeatTimeout=500)
    with GvcpClient(simulated.address) as other:
        receiver.start()
        assert len(receiver.frames(3)) == 3
        assert other.read(CCP) == CONTROL
        receiver.drop()  # leaves without a word
        wait_until(lambda: other.read(CCP) == 0, "the heartbeat ran out", timeout_s=3.0)
        assert not simulated.camera.statistics().acquiring
        assert (other.read(SCP), other.read(SCDA)) == (0, 0)
        assert other.write(CCP, CONTROL) == 0


def test_a_heartbeat_that_is_switched_off(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with GvcpClient(simulated.address) as client:
        assert client.write(CCP, CONTROL) == 0
        assert client.write(HEARTBEAT_TIMEOUT, 500) == 0
        assert client.write(0x0954, 1) == 0
        assert client.silent(0.7)
        assert client.read(CCP) == CONTROL


def test_settings_last_and_go_back_to_default_with_the_user_set(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, exposure_us=750.0) as receiver:
        device, camera = receiver.device, receiver.camera
        assert camera.get_exposure_time() == 750.0
        with pytest.raises(GLib.Error, match="write-protect"):
            camera.set_region(0, 0, 100, 100)
        with pytest.raises(GLib.Error, match="write-protect"):
            device.execute_command("UserSetLoad")
        camera.stop_acquisition()
        camera.set_region(40, 20, 100, 100)
        assert camera.get_payload() == 10_000
        assert tuple(camera.get_x_offset_bounds()) == (0, 220)
        with pytest.raises(GLib.Error, match="invalid-parameter"):
            device.set_integer_feature_value("Width", 300)
        device.execute_command("UserSetLoad")  # acknowledged later, announced by PENDING_ACK
        assert camera.get_exposure_time() == 2000.0
        assert tuple(camera.get_region()) == (0, 0, 320, 240)


def test_pending_acknowledge(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    user_set_load = simulated.camera._device._registers.address("UserSetLoad")
    with GvcpClient(simulated.address) as client:
        assert client.write(CCP, CONTROL) == 0
        number = client.send(Command.WRITEREG, struct.pack(">II", user_set_load, 1))
        first, second = client.hear(), client.hear()
    assert (first.command, first.request_id) == (PENDING_ACK, number)
    assert struct.unpack(">HH", first.payload)[1] > 0
    assert (second.command, second.request_id, second.status) == (Command.WRITEREG + 1, number, 0)


def test_acknowledges_only_where_they_are_wanted(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with GvcpClient(simulated.address) as client:
        client.send(Command.WRITEREG, struct.pack(">II", CCP, CONTROL), flags=0)
        client.send(0x0999, flags=0)
        assert client.silent(0.05)
        assert client.read(CCP) == CONTROL
        ack = client.ask(0x0999)
        assert (ack.status, ack.command) == (Status.NOT_IMPLEMENTED, 0x099A)


def test_several_registers_at_once(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with GvcpClient(simulated.address) as client:
        ack = client.ask(Command.READREG, struct.pack(">III", HEARTBEAT_TIMEOUT, 0x0904, 0x8888))
        assert ack.status == Status.INVALID_ADDRESS
        assert struct.unpack(">II", ack.payload) == (3000, 1), "those before the wrong one"
        client.write(CCP, CONTROL)
        writes = struct.pack(">IIIIII", HEARTBEAT_TIMEOUT, 1000, 0x0904, 7, HEARTBEAT_TIMEOUT, 2000)
        ack = client.ask(Command.WRITEREG, writes)
        assert (ack.status, ack.payload) == (Status.WRITE_PROTECT, struct.pack(">HH", 0, 1))
        assert client.read(HEARTBEAT_TIMEOUT) == 1000


def test_garbage_does_no_harm(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    address = simulated.address
    with Receiver(address) as receiver, GvcpClient(address) as vandal, GvcpClient(address) as client:
        for size in range(64):
            vandal.socket.sendto(os.urandom(size), (address, PORT))
            vandal.socket.sendto(b"\x42\x01" + os.urandom(size), (address, PORT))
        for command in Command:
            vandal.send(command, b"")
            vandal.send(command, bytes(7))
        vandal.send(Command.PACKETRESEND, struct.pack(">HHII", 0, 7, 0, 0xFFFFFF))
        assert len(receiver.frames(5)) == 5
        assert client.read(0x0904) == 1


def test_latch_is_true_within_its_round_trip(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    clock = simulated.clock
    with Receiver(simulated.address) as receiver:
        for _ in range(20):
            before = host_now()
            receiver.device.write_register(TIMESTAMP_CONTROL, 2)
            after = host_now()
            high, low = (receiver.device.read_register(address) for address in (TIMESTAMP_HIGH, TIMESTAMP_LOW))
            assert clock.at(before) <= high << 32 | low <= clock.at(after)
        assert receiver.device.get_integer_feature_value("GevTimestampValue") == high << 32 | low


def test_clock_reset(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        receiver.device.execute_command("GevTimestampControlReset")
        receiver.device.execute_command("GevTimestampControlLatch")
        assert 0 < receiver.device.get_integer_feature_value("GevTimestampValue") < 1_000_000_000


def settle(receiver: Receiver) -> None:
    """Switch PTP on and wait until the camera follows the master."""
    receiver.device.set_boolean_feature_value("PtpEnable", True)
    assert receiver.device.get_string_feature_value("PtpStatus") == "Disabled", "it is that of the last latch"

    def settled() -> bool:
        receiver.device.execute_command("PtpDataSetLatch")
        return str(receiver.device.get_string_feature_value("PtpStatus")) == "Slave"

    wait_until(settled, "PTP has settled")


def test_ptp_brings_two_clocks_together(make_camera: MakeCamera) -> None:
    offset_ns = 1_700_000_000_000_000_000
    epoch = host_now()
    cameras = [make_camera(name, ptp_offset_ns=offset_ns, epoch=epoch) for name in ("K1", "K2")]
    with Receiver(cameras[0].address) as first, Receiver(cameras[1].address) as second:
        assert first.device.get_string_feature_value("GevIEEE1588Status") == "Disabled"
        for receiver in (first, second):
            settle(receiver)
            receiver.device.execute_command("PtpDataSetLatch")
        settled = host_now()
        for receiver in (first, second):
            frame = receiver.first(lambda frame: cameras[0].train.time(frame.pulse) > settled)
            error_ns = frame.device_ns - offset_ns - cameras[0].train.time(frame.pulse)
            residual_ns = receiver.device.get_integer_feature_value("PtpOffsetFromMaster")
            assert abs(residual_ns) <= 300
            assert abs(error_ns - residual_ns) < 10_000, "what is left is the exposure's jitter"


def act(simulated: SimulatedCamera, client: GvcpClient, at: int | None = None, *, group: int = 0x56) -> Status:
    keys = struct.pack(">III", 0x1234, group, 1)
    ack = (
        client.ask(Command.ACTION, keys)
        if at is None
        else client.ask(Command.ACTION, keys + struct.pack(">Q", at), flags=0x81)
    )
    assert ack.command == Command.ACTION + 1
    return Status(ack.status)


def test_action_commands(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with action_receiver(simulated) as receiver, GvcpClient(simulated.address) as client:
        assert act(simulated, client) is Status.SUCCESS
        assert len(receiver.frames(1)) == 1
        client.send(Command.ACTION, struct.pack(">III", 0x1234, 0x57, 1))  # another group
        client.send(Command.ACTION, struct.pack(">III", 0x1235, 0x56, 1))  # another device
        client.send(Command.ACTION, struct.pack(">III", 0x1234, 0x56, 4))  # another mask
        assert client.silent(0.05), "not meant for this camera: no answer"
        assert receiver.frames(1, timeout_s=0.05) == []


def test_scheduled_actions(make_camera: MakeCamera) -> None:
    offset_ns = 1_700_000_000_000_000_000
    simulated = make_camera(ptp_offset_ns=offset_ns)
    with action_receiver(simulated) as receiver, GvcpClient(simulated.address) as client:
        assert act(simulated, client, at=offset_ns) is Status.ERROR, "what is wrong was not asked for"
        receiver.device.set_boolean_feature_value("GevGVCPExtendedStatusCodes", True)
        assert act(simulated, client, at=offset_ns) is Status.NO_REFERENCE_TIME
        settle(receiver)
        begin = host_now() + offset_ns + 100_000_000
        times = [begin + number * 5_000_000 for number in range(10)]
        for time in reversed(times):
            assert act(simulated, client, at=time) is Status.SUCCESS
        assert act(simulated, client, at=begin + 60_000_000) is Status.OVERFLOW
        frames = receiver.frames(11, timeout_s=0.5)
        assert [frame.device_ns for frame in frames] == pytest.approx(times, abs=10_000)
        assert act(simulated, client, at=begin) is Status.ACTION_LATE
        assert len(receiver.frames(1)) == 1, "late, but not never"


def test_automatic_packet_size(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address, packet_size=1500) as receiver:
        receiver.camera.stop_acquisition()
        assert receiver.camera.gv_auto_packet_size() > 60_000, "the loopback's MTU is 65536"


def test_test_packets_have_the_size_that_was_asked_for(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with GvcpClient(simulated.address) as client, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stream:
        stream.bind(("127.0.0.1", 0))
        stream.settimeout(2.0)
        client.write(CCP, CONTROL)
        client.write(SCP, stream.getsockname()[1])
        client.write(SCDA, 0x7F000001)
        assert client.write(SCPS, 1 << 31 | 1 << 30 | 1500) == 0
        data, (address, _) = stream.recvfrom(65536)
        assert (len(data), address) == (1500 - 28, simulated.address)
        assert client.read(SCPS) == 1 << 30 | 1500
        assert client.write(SCPS, 500) == Status.INVALID_PARAMETER


def test_discovery_by_broadcast(make_camera: MakeCamera) -> None:
    simulated = make_camera(broadcast="127.255.255.255")
    with GvcpClient("127.255.255.255") as client:
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        client.send(Command.DISCOVERY)
        peer, data = None, b""
        while peer != (simulated.address, PORT):  # those of other tests answer, too
            data, peer = client.socket.recvfrom(2048)
    assert len(data) == 8 + 0xF8
    assert data[8 + 0x24 : 8 + 0x28] == socket.inet_aton(simulated.address)
    assert data[8 + 0x48 :].startswith(b"Svev\0")


def test_extra_features(make_camera: MakeCamera) -> None:
    simulated = make_camera()
    with Receiver(simulated.address) as receiver:
        device = receiver.device
        assert 20.0 < device.get_float_feature_value("DeviceTemperature") < 50.0
        device.set_string_feature_value("DeviceUserID", "left")
        assert device.get_string_feature_value("DeviceUserID") == "left"
        assert device.get_integer_feature_value("GevTimestampTickFrequency") == 1_000_000_000
        wait_until(lambda: device.get_integer_feature_value("CounterValue") > 3, "triggers are counted")
        device.execute_command("CounterReset")
        assert device.get_integer_feature_value("CounterValue") < 3
        assert receiver.camera.is_software_trigger_supported()
        assert receiver.camera.dup_available_trigger_sources() == ["Line0", "Line1", "Software", "Action0"]


def test_packet_delay(make_camera: MakeCamera) -> None:
    simulated = make_camera(rate_hz=20.0)
    with Receiver(simulated.address, GevSCPD=2_000_000) as receiver:  # 11 packets with 2 ms between them
        pulse = receiver.frames(2)[-1].pulse
    wait_until(lambda: pulse in simulated.camera.statistics().last_packets, "it is noted when its last packet was sent")
    sent = simulated.camera.statistics().last_packets[pulse]
    assert sent >= HostNs(simulated.train.time(pulse) + 1_000_000 + 10 * 2_000_000)
