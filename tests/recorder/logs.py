"""SmallRecord logs for tests: what is written is known, so that what is read can be compared."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import DeviceNs, UtcNs
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.jumper import JumperPoint, JumperState, Measured
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag

OK, LOST, MISSED, DAMAGED, ABSENT = FrameStatus
ALL_OK = (OK, OK, OK)

SHAPE = (24, 90)
#: Name and columns of each camera, for logs with a topic for each.
OWN_TOPICS = (("K1", (0, 30)), ("K2", (30, 60)), ("K3", (60, 90)))
START = UtcNs(1_795_216_434_399_239_000)
PERIOD_NS = 33_333_333
READY_NS = 5_000_000
SESSION = {"athlete": "Anna Berg", "bib": "17"}
RIG = {"name": "test", "cameras": "K1, K2, K3"}
RIG_TOML = b'name = "test"\n'
DESCRIPTION = LogDescription(SESSION, RIG, RIG_TOML)


@dataclass(frozen=True, slots=True)
class Written:
    """One pulse as it was handed to the writer; no image: only the tag."""

    tag: TripletTag
    image: NDArray[np.uint8] | None
    log_time: UtcNs


def make_tag(
    pulse: int, statuses: Sequence[FrameStatus] = ALL_OK, shape: tuple[int, int] = SHAPE, time: UtcNs | None = None
) -> TripletTag:
    """A tag of cameras K1, K2, ... of equal width."""
    pulse_time = UtcNs(START + pulse * PERIOD_NS) if time is None else time
    width = shape[1] // len(statuses)
    cameras = []
    for place, status in enumerate(statuses):
        columns = (place * width, (place + 1) * width)
        if status is OK:
            camera = CameraTag(
                f"K{place + 1}", columns, status, pulse + 7, pulse, DeviceNs(pulse * PERIOD_NS), pulse_time, place - 1.5
            )
        else:
            camera = CameraTag(f"K{place + 1}", columns, status)
        cameras.append(camera)
    return TripletTag(PulseNumber(pulse), pulse_time, "morning", "r1", shape, tuple(cameras))


def make_image(tag: TripletTag) -> NDArray[np.uint8]:
    """Noise that depends on the pulse; black where a camera delivered nothing."""
    image = np.random.default_rng(tag.pulse).integers(1, 256, tag.shape, dtype=np.uint8)
    for camera in tag.cameras:
        if camera.status is not OK:
            image[:, camera.columns[0] : camera.columns[1]] = 0
    return image


def open_writer(path: Path, buffers: TripletBuffers, description: LogDescription = DESCRIPTION) -> LogWriter:
    """A writer with session, rig and rig file of the tests."""
    return LogWriter(path, description, buffers)


def acquire(buffers: TripletBuffers) -> int:
    """A free slot, as soon as there is one."""
    slot = buffers.acquire(timeout_s=10.0)
    assert slot is not None
    return slot


def write_pulse(log: LogWriter, buffers: TripletBuffers, tag: TripletTag) -> Written:
    """Write one pulse as the recorder does; only its tag if no camera delivered."""
    log_time = UtcNs(tag.time + READY_NS)
    if all(camera.status is not OK for camera in tag.cameras):
        log.write_pulse(tag, None, log_time)
        return Written(tag, None, log_time)
    image = make_image(tag)
    slot = acquire(buffers)
    buffers.write(slot, image)
    log.write_pulse(tag, slot, log_time)
    return Written(tag, image, log_time)


def write_log(
    path: Path,
    pulses: Sequence[Sequence[FrameStatus]] = (ALL_OK,) * 4,
    shape: tuple[int, int] = SHAPE,
    cameras: Sequence[tuple[str, tuple[int, int]]] = (),
    description: LogDescription = DESCRIPTION,
    health: tuple[bytes, UtcNs] | None = None,
) -> list[Written]:
    """A closed log with these pulses, a start and a stop event and one health record; `cameras`: with own topics."""
    buffers = TripletBuffers(shape, 4, cameras)
    now = UtcNs(time.time_ns())
    with open_writer(path, buffers, description) as log:
        log.write_event(Event(START, Level.INFO, "recorder", "recording started"))
        written = [
            write_pulse(log, buffers, make_tag(pulse, statuses, shape)) for pulse, statuses in enumerate(pulses, 1)
        ]
        log.write_health(*(health or (b'{"free_triplets":4}', now)))
        log.write_event(Event(now, Level.INFO, "recorder", "recording stopped"))
    buffers.close()
    return written


def jumper_state(pulse: int, recording: str = "jump-1") -> JumperState:
    """A measured jumper at a pulse."""
    variance = ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-4))
    point = JumperPoint((1.0, 2.0, 3.0), variance, ("K1", "K2"), "two rays")
    return JumperState(
        recording=recording,
        jump=1,
        pulse=PulseNumber(pulse),
        time=UtcNs(START + pulse * PERIOD_NS),
        points={"P1": point, "P2": None, "P3": None, "P4": None},
        skis={"right": None, "left": None},
        angles={"alpha": Measured(44.1, 1.0)},
        height=None,
        speed=Measured(26.1, 0.3),
    )
