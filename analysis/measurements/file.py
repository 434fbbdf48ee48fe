"""Reads and writes `svev-measurements/1` files (`measurements.json`): what was measured in the images of a jumper."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from analysis.measurements.entries import (
    FORMAT,
    ImageEntry,
    JumpEntry,
    MeasurementsEntry,
    PointEntry,
    PulseEntry,
    SkiEntry,
)
from analysis.measurements.model import (
    ImageMeasurements,
    JumpMeasurements,
    MeasuredCamera,
    Measurements,
    PointMeasurement,
    PulseMeasurements,
    SkiMeasurement,
)
from photogrammetry.network.strict_text import read_json
from rig.clocks import NS_PER_S, UtcNs
from rig.pulse import PulseNumber
from rig.settings.strict_toml import validate

_PLACE_DIGITS = 4  # of px after the point: far below any sigma
_SIGMA_DIGITS = 6  # that count


def read_measurements(path: Path) -> Measurements:
    """Read a file of measurements.

    Pulses are put in order. Where the file gives no times, the pulses follow each other at its rate from 1970 on.

    Raises:
        BadInputError: missing, unreadable, not JSON, or no measurements; one line with file, key and remedy.
    """
    entry = validate(MeasurementsEntry, read_json(path, "file of measurements"), path)
    cameras = {
        name: MeasuredCamera((camera.size[0], camera.size[1]), camera.exposure_s)
        for name, camera in entry.cameras.items()
    }
    jumps = sorted(entry.jumps, key=lambda jump: jump.number)
    return Measurements(entry.recording, entry.rate_hz, cameras, tuple(_jump(jump, entry.rate_hz) for jump in jumps))


def write_measurements(measurements: Measurements, path: Path) -> None:
    """Write a file of measurements, one line for each pulse."""
    head = {
        "format": FORMAT,
        "recording": measurements.recording,
        "rate_hz": measurements.rate_hz,
        "cameras": {
            name: {"size": list(camera.size), "exposure_s": camera.exposure_s}
            for name, camera in measurements.cameras.items()
        },
    }
    lines = [f'"{key}": {json.dumps(value, ensure_ascii=False)},' for key, value in head.items()]
    jumps = ",\n".join(_jump_text(jump) for jump in measurements.jumps)
    path.write_text("\n".join(["{", *lines, f'"jumps": [{jumps}]', "}", ""]), encoding="utf-8")


def _jump(entry: JumpEntry, rate_hz: float) -> JumpMeasurements:
    pulses = sorted(entry.pulses, key=lambda pulse: pulse.pulse)
    return JumpMeasurements(entry.number, tuple(_pulse(pulse, rate_hz) for pulse in pulses))


def _pulse(entry: PulseEntry, rate_hz: float) -> PulseMeasurements:
    time = round(entry.pulse * NS_PER_S / rate_hz) if entry.time_ns is None else int(entry.time_ns)
    images = {camera: _image(image) for camera, image in entry.images.items()}
    return PulseMeasurements(PulseNumber(entry.pulse), UtcNs(time), images)


def _image(entry: ImageEntry) -> ImageMeasurements:
    return ImageMeasurements(
        {name: _point(point) for name, point in entry.points.items()},
        {side: _ski(ski) for side, ski in entry.skis.items()},
    )


def _point(entry: PointEntry) -> PointMeasurement:
    sigma = np.array(entry.sigmas(2))
    correlation = np.array(((1.0, entry.correlation), (entry.correlation, 1.0)))
    return PointMeasurement(np.array(entry.xy), correlation * np.outer(sigma, sigma), entry.source)


def _ski(entry: SkiEntry) -> SkiMeasurement:
    xy = np.array(entry.xy)
    return SkiMeasurement(xy, np.array(entry.sigmas(len(xy))), entry.source, entry.common, entry.lasting)


def _jump_text(jump: JumpMeasurements) -> str:
    pulses = ",\n".join(json.dumps(_pulse_entry(pulse)) for pulse in jump.pulses)
    return f'{{"number": {jump.number}, "pulses": [\n{pulses}\n]}}'


def _pulse_entry(pulse: PulseMeasurements) -> dict[str, Any]:
    images = {
        camera: {
            "points": {name: _point_entry(point) for name, point in image.points.items()},
            "skis": {side: _ski_entry(ski) for side, ski in image.skis.items()},
        }
        for camera, image in pulse.images.items()
    }
    return {"pulse": int(pulse.pulse), "time_ns": str(int(pulse.time)), "images": images}


def _point_entry(point: PointMeasurement) -> dict[str, Any]:
    sigma = np.sqrt(np.diag(point.covariance))
    correlation = _sigma(point.covariance[0, 1] / sigma.prod())
    entry = {"xy": _places(point.xy), "sigma": [_sigma(s) for s in sigma], "source": point.source.value}
    return entry | {"correlation": correlation} if correlation else entry


def _ski_entry(ski: SkiMeasurement) -> dict[str, Any]:
    entry = {"xy": _places(ski.xy), "sigma": [_sigma(s) for s in ski.sigma], "source": ski.source.value}
    shared = {"common": ski.common, "lasting": ski.lasting}
    return entry | {name: _sigma(value) for name, value in shared.items() if value}


def _places(xy: Any) -> Any:
    return np.round(np.asarray(xy, float), _PLACE_DIGITS).tolist()


def _sigma(value: float) -> float:
    return float(f"{value:.{_SIGMA_DIGITS}g}")
