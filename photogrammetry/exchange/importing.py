"""Carries files of other programs over into one network; which program wrote a file is seen by its name.

The result of `svev calibrate` is taken too: with a survey it makes the survey file of an analysis.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from photogrammetry.exchange.columns import read_aicon, read_survey_csv
from photogrammetry.exchange.part import Part, joined
from photogrammetry.exchange.photomodeler import read_photomodeler
from photogrammetry.exchange.table import ENDINGS
from photogrammetry.exchange.vision.camera_toml import read_camera_toml
from photogrammetry.exchange.vision.colmap import FILES, FRAMES, read_colmap
from photogrammetry.exchange.vision.opencv import read_opencv
from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.file import network_from_json
from photogrammetry.network.formats import RESULT
from photogrammetry.network.model import ImageFrame, Network
from photogrammetry.network.strict_text import read_json
from rig.errors import BadInputError

_OPENCV: Final = (".yml", ".yaml", ".json", ".xml")


@dataclass(frozen=True, slots=True, eq=False)
class Imported:
    """A network of other programs' files, and what to know about it: what was assumed or could not be carried over."""

    network: Network
    notes: tuple[str, ...]


def import_network(
    files: Sequence[Path], *, sigma: float = 1.0, sigma_mm: float | None = None, length_unit: str = "m"
) -> Imported:
    """Carry files over into a network.

    Args:
        files: results of `svev calibrate`, COLMAP's folder or files, calibrations of OpenCV and of anipose (TOML),
            exports of PhotoModeler, files of AICON, surveys.
        sigma: of image points (px) whose file gives none.
        sigma_mm: likewise in files that count in mm.
        length_unit: of the object system.

    Raises:
        BadInputError: a file is none of these, or the files do not fit together.
    """
    parts = list(_parts(files, sigma, sigma_mm))
    source = ", ".join(path.name for path in files)
    network = network_from_json(joined(parts, length_unit), source)
    return Imported(network, tuple(note for part in parts for note in part.notes))


def _parts(files: Sequence[Path], sigma: float, sigma_mm: float | None) -> Iterator[Part]:
    models: dict[Path, dict[str, Path]] = {}
    for path in files:
        folder = path if path.is_dir() else path.parent
        if path.is_dir():
            inside = {name: path / name for name in FILES if (path / name).exists()}
            if not inside:
                raise BadInputError(f"{path}: has none of {', '.join(FILES)}; name the folder of COLMAP's model")
            models.setdefault(folder, {}).update(inside)
        elif path.name in FILES:
            models.setdefault(folder, {})[path.name] = path
        elif path.name not in FRAMES:
            yield _part(path, sigma, sigma_mm)
    for model in models.values():
        yield read_colmap(model, sigma)


def _part(path: Path, sigma: float, sigma_mm: float | None) -> Part:
    ending = path.suffix.lower()
    if ending == ".json" and (result := read_json(path, "calibration")).get("format") == RESULT:
        return _calibrated(path, ImageFrame(result.get("image_frame", ImageFrame.PIXEL.value)))
    if ending in _OPENCV:
        return read_opencv(path, sigma)
    if ending == ".toml":
        return read_camera_toml(path)
    if ending == ".csv":
        return read_survey_csv(path)
    if ending in ENDINGS:
        return read_aicon(path, sigma_mm)
    if ending == ".txt":
        return read_photomodeler(path, sigma)
    known = ", ".join((".txt", ".toml", *_OPENCV, *ENDINGS))
    raise BadInputError(f"{path}: nothing is known that is called so; endings are {known}, or a folder of COLMAP")


def _calibrated(path: Path, frame: ImageFrame) -> Part:
    """The cameras of a calibration of ours, as constants."""
    cameras = {name: camera.model_dump(exclude_none=True) for name, camera in read_calibration(path).items()}
    note = f"{path}: interior orientations of {', '.join(cameras)} are taken as they are, without sigmas"
    return Part(str(path), frame, cameras, notes=(note,))
