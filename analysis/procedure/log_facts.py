"""What the analysis must know of a log before it looks at an image: cameras, rate, exposure times, session."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.measurements.model import MeasuredCamera
from recorder.reading.info import LogInfo, imported_in_words, info
from recorder.reading.parts import RecordingReader
from rig.errors import BadInputError
from rig.phrase import NOTHING, Phrase, phrase
from rig.settings.camera import CameraSettings
from rig.settings.region import calibration_unfit
from rig.settings.strict_toml import examine
from rig.topics import RIG_ATTACHMENT

_EXPOSURE_US = float(CameraSettings.model_fields["exposure_us"].default)


@dataclass(frozen=True, slots=True)
class LogFacts:
    """What a log says about itself.

    Attributes:
        path: the log.
        recording: its id.
        session: fields of the session.
        rate_hz: pulses per second.
        columns: first and one past the last column of each camera's block, by name, left to right.
        cameras: image size and exposure time by name.
        messages: what a person should know.
        part: which part of a recording it is, of which others do not lie beside it; empty text: of none.
    """

    path: Path
    recording: str
    session: Mapping[str, str]
    rate_hz: float
    columns: Mapping[str, tuple[int, int]]
    cameras: Mapping[str, MeasuredCamera]
    messages: tuple[Phrase, ...]
    part: Phrase = NOTHING


def log_facts(path: Path) -> LogFacts:
    """Read what a log says about itself.

    Raises:
        BadInputError: no such file, no log of ours, or a log without pulses.
    """
    about = info(path, whole=True)
    if about.first is None:
        text = "{log}: holds no pulse, so there is nothing to analyze; choose another recording"
        raise BadInputError(phrase("log_no_pulse", text, log=str(path)))
    settings = _cameras(path)
    # The rig file of films without one is made by the import, which knows no exposure times.
    told = [camera for camera in settings if "exposure_us" in camera or not about.imported]
    exposures = {str(camera.get("name")): _exposure_us(camera) for camera in told}
    tags = about.first.cameras
    unknown = [tag.name for tag in tags if tag.name not in exposures]
    messages = [about.part_said] if about.part_said.text else []
    if unknown:
        text = "exposure time of {cameras} is unknown: taken as {us} us"
        messages.append(phrase("log_exposure", text, cameras=", ".join(unknown), us=_EXPOSURE_US))
    messages += [unfit for camera in settings if (unfit := _unfit(camera)) is not None]
    if about.imported:
        text = "{imported}. How late each camera is, is only known from the jumper's own motion"
        messages.append(phrase("log_imported", text, imported=imported_in_words(about.imported)))
    if about.truncated or not about.closed:
        text = "the log was cut off or not closed: what can be read is measured; svev recover makes a whole one"
        messages.append(phrase("log_cut_off", text))
    if about.first.pixels.is_mosaic:
        text = (
            "the cameras have colour filters: grey values are interpolated from neighbours, which softens edges; the "
            "sigmas of ski angles, the roll above all, are too small"
        )
        messages.append(phrase("log_mosaic", text))
    shape = about.first.shape
    cameras = {tag.name: MeasuredCamera(tag.size(shape), exposures.get(tag.name, _EXPOSURE_US) / 1e6) for tag in tags}
    columns = {tag.name: (int(tag.columns[0]), int(tag.columns[1])) for tag in tags}
    return LogFacts(
        path, about.recording, about.session, _rate_hz(about), columns, cameras, tuple(messages), about.part_said
    )


def _rate_hz(about: LogInfo) -> float:
    """Pulses per second, as measured; of a log with a single pulse, as the rig was set up."""
    if about.ledger.rate_hz is not None:
        return float(about.ledger.rate_hz)
    try:
        return float(about.rig["rate_hz"])
    except (KeyError, ValueError):
        text = "{log}: has one pulse and does not say its rate; a jump needs many pulses: choose another recording"
        raise BadInputError(phrase("log_one_pulse", text, log=str(about.path))) from None


def _cameras(path: Path) -> list[dict[str, Any]]:
    """The cameras as the rig file in the log gives them."""
    with RecordingReader(path) as reader:
        for _ in reader.items():
            if RIG_ATTACHMENT in reader.attachments:
                break
        text = reader.attachments.get(RIG_ATTACHMENT, b"")
    try:
        cameras = tomllib.loads(text.decode("utf-8")).get("cameras", [])
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return []
    return [camera for camera in cameras if isinstance(camera, dict)]


def _unfit(camera: dict[str, Any]) -> Phrase | None:
    """Why interior orientations of a camera do not hold for this log, if its rig file says so."""
    settings, _ = examine(CameraSettings, camera)
    return None if settings is None else calibration_unfit(settings)


def _exposure_us(camera: dict[str, Any]) -> float:
    """Exposure time of a camera; if the rig file leaves it out, the default of rig files."""
    given = camera.get("exposure_us", _EXPOSURE_US)
    return float(given) if isinstance(given, (int, float)) and given >= 0 else _EXPOSURE_US
