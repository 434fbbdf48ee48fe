"""What the grabber and the pairing rely on, tested with every camera back end."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from capture.aravis.camera import AravisCamera
from capture.iidc.camera import IidcCamera
from capture.replay.camera import ReplayCamera
from capture.replay.timeline import Timeline
from capture.seam import Arrival, Camera
from capture.sim.camera import SimCamera
from rig.clocks import host_now
from rig.errors import CameraError, CameraNotFoundError
from rig.frame import FrameRecord
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from service.processes.replayed_log import ReplayedLog
from service.processes.simulation import simulated_hill
from simrig.images import stamp
from simrig.programs.scene import SimScene
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.faults import Fault
from tests.capture.iidc.emulated import visible
from tests.capture.replay.hill_log import write_fault, write_hill_log
from tests.capture.rigs import make_rig
from tests.capture.whole import whole_frames
from tests.support.loopback import Loopback

BACKENDS = ["sim", "aravis", "iidc", "replay"]
PERIOD_NS = 33_333_333
_LOGGED_PULSES = 240


class Bench:
    """One camera (K2) of a simulated rig behind a back end."""

    def __init__(self, rig: RigSettings, slots: int) -> None:
        self.rig = rig
        self.epoch = host_now()
        self.ring = CameraRing.create("K2", rig.cameras[0].frame_bytes, slots)
        self.hill: SimulatedHill | None = None
        self.timeline: Timeline | None = None
        self._scene: SimScene | None = None

    def open(self) -> Camera:
        """Connect and configure from scratch."""
        settings = self.rig.cameras[0]
        if settings.backend == "aravis":
            return AravisCamera(settings, self.rig.network, self.ring, self.rig.trigger.period_ns)
        if settings.backend == "iidc":
            return IidcCamera(settings, self.ring, self.rig.trigger.rate_hz)
        if self.timeline is not None:
            return ReplayCamera(settings, self.ring, self.timeline)
        self._scene = self._scene or SimScene(self.rig, 0, self.epoch)
        return SimCamera(settings, self.ring, self._scene)

    def inject(self, kind: str, **fields: Any) -> None:
        """Let a fault befall the next pulse of the open camera."""
        if self.timeline is not None:
            write_fault(self.timeline, kind, fields)
            return
        fault = Fault.model_validate({"kind": kind, "camera": "K2", **fields})
        target = self.hill or self._scene
        assert target is not None
        target.inject(fault)

    def stamp_of(self, arrival: FrameRecord) -> int:
        """Hill pulse that the stamp in the frame names."""
        shape = (self.rig.cameras[0].region.height, self.rig.cameras[0].region.width)
        found = stamp.read(self.ring.frame(arrival.slot).reshape(shape))
        assert found is not None
        assert found.camera == 1
        return found.pulse


OpenBench = Callable[..., Bench]


@pytest.fixture(scope="module")
def hill_log(tmp_path_factory: pytest.TempPathFactory) -> Callable[[RigSettings, int], Path]:
    """Logs of one camera of the simulated hill; the same one is made once."""
    made: dict[str, Path] = {}

    def make(simulated: RigSettings, pulses: int) -> Path:
        assert simulated.simulation is not None
        key = simulated.simulation.scenario.read_text()
        if key not in made:
            made[key] = tmp_path_factory.mktemp("log") / "hill.mcap"
            write_hill_log(made[key], simulated, pulses)
        return made[key]

    return make


@pytest.fixture(params=BACKENDS)
def bench(
    request: pytest.FixtureRequest,
    tmp_path: Path,
    loopback: Loopback,
    hill_log: Callable[[RigSettings, int], Path],
) -> Iterator[OpenBench]:
    with ExitStack() as stack:

        def open_bench(slots: int = 16, **options: Any) -> Bench:
            replayed = request.param == "replay"
            if replayed:
                simulated = make_rig(tmp_path, "sim", loopback, names=["K2"], **options)
                options = {"log": hill_log(simulated, 2 if "scenario" in options else _LOGGED_PULSES)}
            made = Bench(make_rig(tmp_path, request.param, loopback, names=["K2"], **options), slots)
            stack.callback(made.ring.close)
            if replayed:
                log = ReplayedLog(made.rig, 0)
                stack.callback(log.close)
                made.epoch = host_now()
                made.timeline = Timeline(log, made.epoch)
            made.hill = stack.enter_context(simulated_hill(made.rig, made.epoch))
            if request.param == "iidc" and made.hill is not None:
                stack.enter_context(visible(made.hill))
            return made

        yield open_bench


@contextmanager
def _open(bench: Bench) -> Iterator[Camera]:
    camera = bench.open()
    try:
        camera.start()
        yield camera
    finally:
        camera.close()


@contextmanager
def _warm(bench: Bench) -> Iterator[Camera]:
    """An open camera that has delivered its first frames; frames may be lost while its stream is set up."""
    with _open(bench) as camera:
        _collect(bench, camera, 3)
        yield camera


def _collect(bench: Bench, camera: Camera, count: int) -> list[tuple[Arrival, int | None]]:
    """The next `count` arrivals, each with the hill pulse of its stamp; slots are given back at once."""
    collected: list[tuple[Arrival, int | None]] = []
    deadline = host_now() + 20_000_000_000
    while len(collected) < count:
        assert host_now() < deadline, f"only {len(collected)} of {count} arrivals came"
        arrival = camera.receive(0.2)
        if arrival is None:
            continue
        collected.append((arrival, bench.stamp_of(arrival) if isinstance(arrival, FrameRecord) else None))
        if isinstance(arrival, FrameRecord):
            bench.ring.return_slot(arrival.slot)
    return collected


def test_every_pulse_gives_one_frame_with_its_own_pixels_id_and_time(bench: OpenBench) -> None:
    made = bench()
    with _warm(made) as camera:
        frames = _collect(made, camera, 20)
    whole = whole_frames(arrival for arrival, _ in frames)
    pulses = np.array([pulse for _, pulse in frames])
    assert np.all(np.diff(pulses) == 1)
    assert np.all(np.diff([arrival.frame_id for arrival in whole]) == 1)
    steps = np.diff([arrival.device_time for arrival in whole])
    assert np.all(np.abs(steps - PERIOD_NS) < 100_000)  # 100 ppm of drift and some us of jitter


def test_latch_ties_the_device_clock_to_the_host(bench: OpenBench) -> None:
    made = bench()
    with _warm(made) as camera:
        latch = min((camera.latch() for _ in range(20)), key=lambda taken: taken.round_trip_ns)
        ((arrival, pulse),) = _collect(made, camera, 1)
    assert pulse is not None
    assert isinstance(arrival, FrameRecord)
    trigger = latch.host + (arrival.device_time - latch.device)
    fired = made.epoch + round(pulse * 1e9 / made.rig.trigger.rate_hz)
    assert abs(trigger - fired) <= latch.round_trip_ns / 2 + 100_000
    assert fired < arrival.host_time


def test_without_pulses_receive_comes_back_empty(bench: OpenBench) -> None:
    made = bench(scenario="pauses = [[1, 100000]]")
    with _open(made) as camera:
        before = host_now()
        assert camera.receive(0.1) is None
        assert host_now() - before < 1_000_000_000


#: Fault, its fields, difference of the ids before and after it.
FAULTS: list[tuple[str, dict[str, Any], int]] = [
    ("missed_pulse", {}, 1),
    ("lost_frame", {}, 2),
    ("damaged_frame", {}, 2),
    ("lost_leader", {"resend": False}, 2),
    ("lost_packets", {"packets": [3, 4], "resend": False}, 2),
]
#: FireWire does not report damage. What a lost packet does there: `tests/capture/iidc`.
FAULTS_ON_FIREWIRE = [fault for fault in FAULTS if fault[0] not in {"damaged_frame", "lost_packets"}]


@pytest.mark.parametrize(
    ("bench", "kind", "fields", "id_step"),
    [(backend, *fault) for backend in BACKENDS for fault in (FAULTS_ON_FIREWIRE if backend == "iidc" else FAULTS)],
    indirect=["bench"],
)
def test_a_fault_costs_one_frame_and_the_ids_tell_why(
    bench: OpenBench, kind: str, fields: dict[str, Any], id_step: int
) -> None:
    made = bench()
    with _warm(made) as camera:
        arrivals = _collect(made, camera, 3)
        made.inject(kind, **fields)
        arrivals += _collect(made, camera, 12)
    frames = [(pulse, arrival) for arrival, pulse in arrivals if pulse is not None and isinstance(arrival, FrameRecord)]
    pulses = np.array([pulse for pulse, _ in frames])
    ids = np.array([arrival.frame_id for _, arrival in frames])
    times = np.array([arrival.device_time for _, arrival in frames])
    (gap,) = np.flatnonzero(np.diff(pulses) != 1)
    assert np.diff(pulses)[gap] == 2
    assert np.diff(ids)[gap] == id_step
    assert np.diff(ids).sum() == len(ids) - 2 + id_step
    assert abs(np.diff(times)[gap] - 2 * PERIOD_NS) < 200_000


@pytest.mark.parametrize("bench", ["sim", "aravis"], indirect=True)  # FireWire resends no packets
def test_packets_that_are_sent_again_cost_nothing(bench: OpenBench) -> None:
    made = bench()
    with _warm(made) as camera:
        _collect(made, camera, 3)
        made.inject("lost_packets", packets=[3, 4])
        pulses = [pulse for _, pulse in _collect(made, camera, 12)]
    assert pulses[0] is not None
    assert pulses == list(range(pulses[0], pulses[0] + 12))


def test_closing_gives_all_slots_back_and_the_camera_opens_again(bench: OpenBench) -> None:
    made = bench()
    for _ in range(2):
        with _open(made) as camera:
            _collect(made, camera, 3)
        taken = [made.ring.take_slot() for _ in range(made.ring.slots)]
        assert taken == list(range(made.ring.slots))
        made.ring.reclaim()


def test_a_recorder_that_holds_all_slots_costs_frames_but_nothing_breaks(bench: OpenBench) -> None:
    made = bench(slots=4)
    with _warm(made) as camera:
        held: list[FrameRecord] = []
        while len(held) < made.ring.slots:
            if isinstance(arrival := camera.receive(0.2), FrameRecord):
                held.append(arrival)
        last = made.stamp_of(held[-1])
        while camera.receive(0.2) is not None:
            pass
        for frame in held:
            made.ring.return_slot(frame.slot)
        pulses = [pulse for _, pulse in _collect(made, camera, 6) if pulse is not None]
    assert pulses
    assert pulses == sorted(set(pulses))
    assert pulses[0] > last


def test_a_dead_camera_is_an_error_in_bounded_time_and_comes_back_from_scratch(bench: OpenBench) -> None:
    made = bench()
    with _warm(made) as camera:
        _collect(made, camera, 3)
        made.inject("restart", duration_s=0.5)
        with pytest.raises(CameraError):
            _use_until_it_fails(made, camera)
    with _reopened(made) as camera:
        assert all(isinstance(arrival, FrameRecord) for arrival, _ in _collect(made, camera, 3))


@contextmanager
def _reopened(bench: Bench) -> Iterator[Camera]:
    """Try again, as the grabber does, until the camera is back."""
    deadline = host_now() + 20_000_000_000
    while True:
        try:
            camera = bench.open()
            break
        except (CameraError, CameraNotFoundError):
            assert host_now() < deadline
    try:
        camera.start()
        yield camera
    finally:
        camera.close()


def _use_until_it_fails(bench: Bench, camera: Camera) -> None:
    deadline = host_now() + 20_000_000_000
    while host_now() < deadline:
        if isinstance(arrival := camera.receive(0.2), FrameRecord):
            bench.ring.return_slot(arrival.slot)
        camera.latch()
