"""Writes the truth of a recording of simulated cameras, and the survey of their hill, into files."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final

import msgspec

from rig.clocks import HostNs
from rig.host.file_names import unfinished_path
from rig.pulse import HillPulse, PulseNumber
from rig.settings.camera import CameraSettings, Region
from rig.settings.model import RigSettings
from simrig.firewire.camera.geometry import SENSOR, VGA
from simrig.world.projection import Window
from simrig.world.pulses import PulseTrain
from simrig.world.scenario import load_scenario
from simrig.world.survey import windowed_survey
from simrig.world.truth import Truth

_VGA_REGION: Final = Region(width=VGA[0], height=VGA[1])


class RecordingTruth:
    """What the simulated cameras of a rig really saw.

    Which hill pulse a pulse of a recording is follows from its time alone: all cameras see the pulses of one train on
    the host's clock, and the recorder knows their times far better than to half a period. Nothing is read from images.

    Args:
        rig: a rig with a `[simulation]` table.
        scenario: its scenario file.
        epoch: host time of hill pulse 0.

    Raises:
        BadInputError: the scenario is wrong.
    """

    def __init__(self, rig: RigSettings, scenario: Path, epoch: HostNs) -> None:
        loaded = load_scenario(scenario)
        self._train = PulseTrain(epoch, rig.trigger.rate_hz, loaded.pauses)
        self._truth = Truth(loaded, rig.trigger.rate_hz, windows(rig))
        self._survey = windowed_survey(loaded, windows(rig))

    def write(self, truth: Path, survey: Path, pulses: Iterable[tuple[PulseNumber, HostNs]]) -> None:
        """Write each file in one go, the survey first: it is there as a whole or not at all.

        A pulse at whose time the hill fired none is left out. Pulses are written as they come: the truth of an hour
        would not fit into memory as objects.

        Args:
            truth: the file of the truth.
            survey: the file of the survey, for `svev analyze`.
            pulses: number and host time of each pulse of the recording; what it raises ends the writing.

        Raises:
            OSError: the disk refuses.
        """
        with _whole(survey) as file:
            file.write(json.dumps(self._survey, indent=1).encode() + b"\n")
        with _whole(truth) as file:
            self._write_truth(file, pulses)

    def _write_truth(self, file: BinaryIO, pulses: Iterable[tuple[PulseNumber, HostNs]]) -> None:
        encode = msgspec.json.Encoder().encode
        hill_pulses: dict[str, HillPulse] = {}
        written: set[HillPulse] = set()
        file.write(encode(self._truth.setting())[:-1] + b',"pulses":[')
        for number, time in pulses:
            fired = self._train.fired_at(time)
            if fired is None:
                continue
            hill_pulses[str(number)] = fired
            if fired not in written:
                file.write((b",\n" if written else b"\n") + encode(self._truth.state(fired)))
                written.add(fired)
        file.write(b'],\n"hill_pulse_of_recording":' + encode(hill_pulses) + b"}\n")


@contextmanager
def _whole(path: Path) -> Iterator[BinaryIO]:
    """A file that gets its name when all of it is written."""
    unfinished = unfinished_path(path, ".unfinished")
    try:
        with unfinished.open("wb") as file:
            yield file
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def windows(rig: RigSettings) -> dict[str, Window]:
    """Which part of the image that a simulated camera draws is in the log, by camera."""
    return {camera.name: _window(camera, gige_sensor(rig)) for camera in rig.cameras}


def _window(camera: CameraSettings, gige: tuple[int, int]) -> Window:
    region = camera.region
    left, top = region.x, region.y
    match camera.backend:
        case "aravis":
            full = gige
        case "iidc":  # the middle of the sensor shows what the scenario says, in VGA; Format_0 reads that out
            full = VGA
            if region != _VGA_REGION:
                left, top = left - (SENSOR[0] - VGA[0]) // 2, top - (SENSOR[1] - VGA[1]) // 2
        case _:
            left, top, full = 0, 0, (region.width, region.height)
    return Window(full, left, top, region.width, region.height)


def gige_sensor(rig: RigSettings) -> tuple[int, int]:
    """Width and height of the sensor of all simulated GigE Vision cameras of a rig: each region fits into it.

    So does the one before it was changed: a sensor does not change with the part of it that is read out.
    """
    cameras = [camera for camera in rig.cameras if camera.backend == "aravis"]
    regions = [region for camera in cameras for region in (camera.region, camera.calibrated_region) if region]
    regions = regions or [_VGA_REGION]
    return max(each.x + each.width for each in regions), max(each.y + each.height for each in regions)
