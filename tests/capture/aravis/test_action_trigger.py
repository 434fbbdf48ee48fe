"""GigE Vision cameras that expose at action commands: real commands, real Aravis, real packets."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest

from capture.aravis.camera import AravisCamera
from rig.action import ActionKeys
from rig.clocks import HostNs, host_now
from rig.errors import CameraError
from rig.frame import FrameRecord, LatchRecord
from rig.settings.model import RigSettings
from rig.settings.trigger import ActionTrigger
from rig.transport.ring import CameraRing
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from simrig.gige.registers.makers import DIALECTS, Maker
from simrig.gige.registers.register_table import PtpStatus
from tests.capture.rigs import SCENARIO, make_rig
from tests.capture.station import Station
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from triggering.sources.action_sender import ActionSender
from triggering.sources.gate import Gate

PTP_NS = 1_795_216_434_000_000_000
NAMES = ["K1", "K2"]


class _Hill:
    """Two simulated cameras in this process, as the back end and as the sender of the commands see them."""

    def __init__(self, rig: RigSettings, maker: Maker, broadcast: str | None) -> None:
        self.rig, self.origin = rig, host_now()
        self.cameras = [
            Camera(
                CameraConfig(
                    name=settings.name, address=settings.address, scenario=SCENARIO, rate_hz=rig.trigger.rate_hz,
                    epoch=self.origin, test_pattern=True, ptp_offset_ns=PTP_NS, maker=maker, broadcast=broadcast,
                )
            )
            for settings in rig.cameras
        ]  # fmt: skip
        self.rings = [CameraRing.create(camera.name, camera.frame_bytes, 16) for camera in rig.cameras]

    def open(self, index: int, ring: CameraRing) -> AravisCamera:
        rig = self.rig
        return AravisCamera(rig.cameras[index], rig.network, ring, rig.trigger.period_ns, rig.trigger, self.origin)

    @contextmanager
    def sender(self, trigger: ActionTrigger, origin: HostNs | None = None) -> Iterator[ActionSender]:
        """The sender of the commands; `origin`: as another program has it."""
        places = [(camera.address, camera.name) for camera in self.rig.cameras]
        sender = ActionSender(trigger, origin or self.origin, places, Gate())
        sender.start()
        try:
            yield sender
        finally:
            sender.stop()


@contextmanager
def _hill(
    folder: Path, loopback: Loopback, maker: Maker = Maker.STANDARD, broadcast: str | None = None
) -> Iterator[_Hill]:
    hill = _Hill(make_rig(folder, "aravis", loopback, names=NAMES, source="action", rate_hz=20.0), maker, broadcast)
    for camera in hill.cameras:
        camera.start()
    try:
        yield hill
    finally:
        for camera in hill.cameras:
            camera.stop()
        for ring in hill.rings:
            ring.close()


def _makers(feature: str, entry: str) -> list[Maker]:
    """Those whose enumeration has such an entry."""
    return [
        maker
        for maker, dialect in DIALECTS.items()
        if any(each.startswith(entry) for each in dialect.entries.get(feature, ()))
    ]


def _trigger(**more: object) -> ActionTrigger:
    return ActionTrigger.model_validate({"source": "action", "rate_hz": 20.0, **more})


def _with(hill: _Hill, trigger: ActionTrigger) -> None:
    hill.rig = hill.rig.model_copy(update={"trigger": trigger})


def test_scheduled_commands_by_broadcast_expose_all_cameras_at_whole_multiples_of_the_period(
    tmp_path: Path, loopback: Loopback
) -> None:
    trigger = _trigger(scheduled=True, lead_ms=20.0, broadcast=["127.255.255.255"])
    with _hill(tmp_path, loopback, broadcast="127.255.255.255") as hill:
        _with(hill, trigger)
        with ExitStack() as stack:
            # One after the other: a camera that is being opened has all new sockets of its process filtered.
            stations = []
            for index, ring in enumerate(hill.rings):
                stations.append(stack.enter_context(Station(partial(hill.open, index), ring)))
                stations[-1].await_records(LatchRecord, 16)
            sender = stack.enter_context(hill.sender(trigger))
            assert sender.seen([True, True], [PTP_NS, PTP_NS]) == []
            for station in stations:
                station.await_records(FrameRecord, 8)
            told = sender.read()
            assert min(each.acknowledged for each in sender.counts) >= 7, told
    times = [
        [record.device_time for record in station.records if isinstance(record, FrameRecord)] for station in stations
    ]
    punctual = [[time for time in each if (time + 5_000) % trigger.period_ns < 10_000] for each in times]
    assert all(len(each) >= 5 for each in punctual), "the busy machine made too many commands late"
    pulses = [{round(time / trigger.period_ns) for time in each} for each in punctual]
    assert len(pulses[0] & pulses[1]) >= 4


@pytest.mark.parametrize("maker", _makers("TriggerSource", "Action"))
def test_commands_at_once_to_each_camera_by_the_names_of_another_maker(
    tmp_path: Path, loopback: Loopback, maker: Maker
) -> None:
    """The trigger is Action0 or Action1, and which action's keys are set is a number, a name, or cannot be chosen."""
    with _hill(tmp_path, loopback, maker) as hill, Station(partial(hill.open, 0), hill.rings[0]) as station:
        station.await_records(LatchRecord, 16)
        with hill.sender(_trigger()) as sender:
            sender.seen([True, False], [None, None])
            station.await_records(FrameRecord, 4)
            sender.read()
            counts = sender.counts
    assert counts[0].acknowledged >= 3
    assert counts[1].unanswered == counts[1].acknowledged == 0, "nobody waits for a camera that is not there"


def test_a_camera_without_reference_time_and_one_that_answers_nothing_are_told_by_name(
    tmp_path: Path, loopback: Loopback
) -> None:
    """K1 has lost its lock; K2 is controlled by nobody, so that it heeds no command."""
    trigger, told = _trigger(scheduled=True), list[str]()
    with _hill(tmp_path, loopback) as hill:
        _with(hill, trigger)
        camera = hill.open(0, hill.rings[0])
        try:
            hill.cameras[0]._device._clock.enable_ptp(False, host_now())
            with hill.sender(trigger) as sender:
                sender.seen([True, True], [PTP_NS, PTP_NS])

                def both_told() -> bool:
                    told.extend(str(said) for said in sender.read())
                    return len(told) >= 2

                wait_until(both_told, "both cameras are told of")
                first, second = sender.counts
        finally:
            camera.close()
    assert sorted(said.split(":")[0] for said in told) == [
        "K1 has no reference time, so it does not expose", "K2 does not answer action commands",
    ]  # fmt: skip
    assert (first.acknowledged, second.acknowledged) == (0, 0)
    assert min(first.refused, second.unanswered) >= 3


@pytest.mark.parametrize("maker", [Maker.FLIR, Maker.ALLIED_VISION, Maker.BASLER, Maker.BASLER_ACE_2])
def test_ptp_is_switched_on_by_whatever_name_it_has(tmp_path: Path, loopback: Loopback, maker: Maker) -> None:
    with _hill(tmp_path, loopback, maker) as hill:
        _with(hill, _trigger(scheduled=True))
        hill.open(0, hill.rings[0]).close()
        assert hill.cameras[0]._device._clock.ptp_status(host_now()) is PtpStatus.SLAVE


def test_commands_of_another_rig_expose_nothing(tmp_path: Path, loopback: Loopback) -> None:
    with _hill(tmp_path, loopback) as hill:
        camera = hill.open(0, hill.rings[0])
        try:
            camera.start()
            with hill.sender(_trigger(), HostNs(hill.origin + 10**9)) as sender:
                sender.seen([True, False], [None, None])

                def ignored() -> bool:
                    sender.read()
                    return sender.counts[0].unanswered >= 3

                wait_until(ignored, "three commands were ignored")
                assert sender.counts[0].acknowledged == 0
            assert camera.receive(0.0) is None
        finally:
            camera.close()
    assert ActionKeys.of(hill.origin) != ActionKeys.of(HostNs(hill.origin + 10**9))


def test_commands_that_cannot_be_sent_are_told() -> None:
    """The system refuses to send to such an address."""
    sender, told = ActionSender(_trigger(), host_now(), [("::1", "K1")], Gate()), list[str]()
    sender.start()
    try:

        def said() -> bool:
            told.extend(str(each) for each in sender.read())
            return bool(told)

        wait_until(said, "the failure is told")
    finally:
        sender.stop()
    assert told[0].startswith("action commands cannot be sent to ::1 (")


@pytest.mark.parametrize(
    ("maker", "scheduled", "told"),
    [
        (Maker.PROSILICA, False, r"camera K1 has no action trigger \(its TriggerSource has Line1, Line2, Software\)"),
        (Maker.JAI, False, "camera K1 has no action trigger"),
        (Maker.BASLER, True, "camera K1 has no PTP lock"),
    ],
)
def test_a_camera_that_cannot_is_refused(
    tmp_path: Path, loopback: Loopback, maker: Maker, scheduled: bool, told: str
) -> None:
    with _hill(tmp_path, loopback, maker) as hill:
        _with(hill, _trigger(scheduled=scheduled))
        for camera in hill.cameras:  # a master that nobody hears
            camera._device._clock.ptp_status = lambda _: 8  # type: ignore[method-assign,return-value,assignment]
        with pytest.raises(CameraError, match=told):
            hill.open(0, hill.rings[0])
