"""Logs of a simulated hill without cameras: rendered, written as the recorder does, with their survey and truth."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import NS_PER_S, DeviceNs, UtcNs
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.pulse import HillPulse, PulseNumber
from rig.tag import CameraTag, TripletTag
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario
from simrig.world.survey import survey
from simrig.world.truth import truth

START = 1_795_216_434_000_000_000  #: UTC of hill pulse 0, ns


@dataclass(frozen=True, slots=True)
class HillLog:
    """A log and what belongs to it.

    Attributes:
        path: the log.
        survey: survey of the balls.
        truth: of its pulses, by number in the log.
    """

    path: Path
    survey: Path
    truth: dict[int, dict[str, Any]]


class View(Protocol):
    """What one camera sees."""

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width)."""


def write_hill_log(
    path: Path,
    scenario: Scenario,
    pulses: Sequence[int],
    size: tuple[int, int] = (640, 480),
    rate_hz: float = 30.0,
    views: Sequence[View] | None = None,
) -> HillLog:
    """Render hill pulses into a log, numbered from 1.

    Args:
        path: the log, without its ending.
        scenario: the hill.
        pulses: hill pulses.
        size: width and height of the images, px.
        rate_hz: pulses per second.
        views: what the cameras of the scenario see, if it is not to be rendered from it.
    """
    width, height = size
    views = views or [CameraView(scenario, index, width, height, rate_hz) for index in range(len(scenario.cameras))]
    shape = (height, width * len(views))
    log = path.with_suffix(".mcap")
    buffers = TripletBuffers(shape, 8)
    with LogWriter(log, _description(path.name, scenario, rate_hz), buffers) as writer:
        for number, pulse in enumerate(pulses, 1):
            time = UtcNs(START + round(pulse * NS_PER_S / rate_hz))
            slot = buffers.acquire(timeout_s=10.0)
            if slot is None:
                raise RuntimeError("the log writer does not give its buffers back")
            buffers.write(slot, _triplet(views, size, pulse))
            writer.write_pulse(_tag(number, time, shape, scenario, path.name), slot, time)
    buffers.close()
    surveyed = path.with_suffix(".survey.json")
    surveyed.write_text(json.dumps(survey(scenario, size)), encoding="utf-8")
    states = truth(scenario, [HillPulse(pulse) for pulse in pulses], rate_hz, size)["pulses"]
    return HillLog(log, surveyed, dict(enumerate(states, 1)))


def _triplet(views: Sequence[View], size: tuple[int, int], pulse: int) -> NDArray[np.uint8]:
    """The images of all cameras at a hill pulse, side by side."""
    images = []
    for view in views:
        image = np.empty(size[::-1], np.uint8)
        view.render_into(image, HillPulse(pulse))
        images.append(image)
    return np.hstack(images)


def _description(recording: str, scenario: Scenario, rate_hz: float) -> LogDescription:
    cameras = "".join(
        f'[[cameras]]\nname = "{camera.name}"\nexposure_us = {camera.exposure_us or 1.0}\n'
        for camera in scenario.cameras
    )
    rig = {"name": scenario.name, "cameras": ", ".join(c.name for c in scenario.cameras), "rate_hz": str(rate_hz)}
    return LogDescription({"recording": recording, "athlete": "Anna Berg", "bib": "17"}, rig, cameras.encode())


def _tag(number: int, time: UtcNs, shape: tuple[int, int], scenario: Scenario, recording: str) -> TripletTag:
    width = shape[1] // len(scenario.cameras)
    cameras = tuple(
        CameraTag(
            camera.name,
            (place * width, (place + 1) * width),
            FrameStatus.OK,
            number,
            number,
            DeviceNs(number),
            time,
            0.0,
        )
        for place, camera in enumerate(scenario.cameras)
    )
    return TripletTag(PulseNumber(number), time, "", recording, shape, cameras)
