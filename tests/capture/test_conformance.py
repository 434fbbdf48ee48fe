"""One suite over every camera back end: what the grabber and the pairing rely on."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simrig.simulated_hill import SimulatedHill

from capture.aravis_camera import AravisCamera
from capture.seam import Arrival, Camera
from capture.sim_camera import SimCamera
from rig.clocks import host_now
from rig.errors import CameraError
from rig.ring import CameraRing
from rig.settings import RigSettings
from simrig import stamp
from svev.sim_scene import SimScene
from tests.capture.rigs import make_rig
from tests.support.loopback import Loopback

BACKENDS = ["sim", "aravis"]
PERIOD_NS = 33_333_333


class Bench:
    """One camera (K2) of a simulated rig behind a back end."""

    def __init__(self, rig: RigSettings, slots: int) -> None:
        self.rig = rig
        self.epoch = host_now()
        self.ring = CameraRing.create("K2", rig.cameras[1].frame_bytes, slots)
        self.hill: SimulatedHill | None = None

    def open(self) -> Camera:
        """Connect and configure from scratch."""
        settings = self.rig.cameras[1]
        if settings.backend == "aravis":
            return AravisCamera(settings, self.rig.network, self.ring, self.rig.trigger.period_ns)
        return SimCamera(settings, self.ring, SimScene(self.rig, 1, self.epoch))

    def stamp_of(self, arrival: Arrival) -> int:
        """Hill pulse that the frame's own pixels name."""
        shape = (self.rig.cameras[1].region.height, self.rig.cameras[1].region.width)
        found = stamp.read(self.ring.frame(arrival.slot).reshape(shape))
        assert found is not None
        assert found.camera == 1
        return found.pulse


OpenBench = Callable[..., Bench]


@pytest.fixture(params=BACKENDS)
def bench(request: pytest.FixtureRequest, tmp_path: Path, loopback: Loopback) -> Iterator[OpenBench]:
    with ExitStack() as stack:

        def open_bench(slots: int = 16, **options: Any) -> Bench:
            made = Bench(make_rig(tmp_path, request.param, loopback, **options), slots)
            stack.callback(made.ring.close)
            # made.hill = stack.enter_context(simulated_hill(made.rig, made.epoch))
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


def _collect(bench: Bench, camera: Camera, count: int) -> list[tuple[Arrival, int | None]]:
    """The next `count` arrivals, each with the pulse in its pixels; slots are given back at once."""
    collected: list[tuple[Arrival, int | None]] = []
    deadline = host_now() + 20_000_000_000
    while len(collected) < count:
        assert host_now() < deadline, f"only {len(collected)} of {count} arrivals came"
        arrival = camera.receive(0.2)
        if arrival is None:
            continue
        collected.append((arrival, bench.stamp_of(arrival) if arrival.whole else None))
        if arrival.whole:
            bench.ring.return_slot(arrival.slot)
    return collected


def test_every_pulse_gives_one_frame_with_its_own_pixels_id_and_time(bench: OpenBench) -> None:
    made = bench()
    with _open(made) as camera:
        frames = _collect(made, camera, 20)
    assert all(arrival.whole for arrival, _ in frames)
    pulses = np.array([pulse for _, pulse in frames])
    assert np.all(np.diff(pulses) == 1)
    assert np.all(np.diff([arrival.frame_id for arrival, _ in frames]) == 1)
    steps = np.diff([arrival.device_time for arrival, _ in frames])
    assert np.all(np.abs(steps - PERIOD_NS) < 100_000)  # 100 ppm of drift and some us of jitter


def test_latch_ties_the_device_clock_to_the_host(bench: OpenBench) -> None:
    made = bench()
    with _open(made) as camera:
        latch = min((camera.latch() for _ in range(20)), key=lambda taken: taken.round_trip_ns)
        ((arrival, pulse),) = _collect(made, camera, 1)
    assert pulse is not None
    trigger = latch.host + (arrival.device_time - latch.device)
    fired = made.epoch + round(pulse * 1e9 / made.rig.trigger.rate_hz)
    assert abs(trigger - fired) <= latch.round_trip_ns / 2 + 100_000
    assert fired < arrival.host_time


def test_without_pulses_receive_comes_back_empty(bench: OpenBench) -> None:
    made = bench(scenario="pauses = [[0, 100000]]")
    with _open(made) as camera:
        before = host_now()
        assert camera.receive(0.1) is None
        assert host_now() - before < 1_000_000_000


def test_a_missed_pulse_leaves_no_gap_in_the_ids_but_one_in_time(bench: OpenBench) -> None:
    made = bench(faults=[{"kind": "missed_pulse", "camera": "K2", "at_pulse": 40}])
    with _open(made) as camera:
        frames = _until_pulse(made, camera, 42)
    step = frames[41][0].frame_id - frames[39][0].frame_id
    assert 40 not in frames
    assert step == 1
    assert frames[41][0].device_time - frames[39][0].device_time > 1.9 * PERIOD_NS


def test_a_lost_frame_leaves_a_gap_in_the_ids(bench: OpenBench) -> None:
    made = bench(faults=[{"kind": "lost_frame", "camera": "K2", "at_pulse": 40}])
    with _open(made) as camera:
        frames = _until_pulse(made, camera, 42)
    assert 40 not in frames
    assert frames[41][0].frame_id - frames[39][0].frame_id == 2


@pytest.mark.parametrize("kind", ["damaged_frame", "lost_leader"])
def test_a_damaged_frame_is_never_handed_over_as_whole(bench: OpenBench, kind: str) -> None:
    fault: dict[str, Any] = {"kind": kind, "camera": "K2", "at_pulse": 40}
    made = bench(faults=[fault | ({"resend": False} if kind == "lost_leader" else {})])
    with _open(made) as camera:
        frames = _until_pulse(made, camera, 43)
    assert 40 not in frames
    assert frames[41][0].frame_id - frames[39][0].frame_id == 2


def _until_pulse(bench: Bench, camera: Camera, last: int) -> dict[int, tuple[Arrival, int | None]]:
    """Whole frames by the pulse in their pixels, until pulse `last`."""
    frames: dict[int, tuple[Arrival, int | None]] = {}
    while last not in frames:
        for arrival, pulse in _collect(bench, camera, 1):
            if pulse is not None:
                frames[pulse] = (arrival, pulse)
    return frames


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
    with _open(made) as camera:
        held: list[Arrival] = []
        while len(held) < 4:
            if (arrival := camera.receive(0.2)) is not None:
                held.append(arrival)
        while camera.receive(0.2) is not None:
            pass
        for arrival in held:
            made.ring.return_slot(arrival.slot)
        first = made.stamp_of(held[-1])
        assert _collect(made, camera, 3)[0][1] > first  # type: ignore[operator]


def test_a_dead_camera_is_an_error_in_bounded_time_and_comes_back_from_scratch(bench: OpenBench) -> None:
    made = bench(faults=[{"kind": "restart", "camera": "K2", "at_pulse": 20, "duration_s": 0.5}])
    camera = made.open()
    camera.start()
    try:
        with pytest.raises(CameraError):
            _use_until_it_fails(made, camera)
    finally:
        camera.close()
    deadline = host_now() + 20_000_000_000
    while True:
        assert host_now() < deadline
        try:
            camera = made.open()
        except CameraError:
            continue
        break
    camera.start()
    try:
        assert all(arrival.whole for arrival, _ in _collect(made, camera, 3))
    finally:
        camera.close()


def _use_until_it_fails(bench: Bench, camera: Camera) -> None:
    deadline = host_now() + 20_000_000_000
    while host_now() < deadline:
        if (arrival := camera.receive(0.2)) is not None and arrival.whole:
            bench.ring.return_slot(arrival.slot)
        camera.latch()
