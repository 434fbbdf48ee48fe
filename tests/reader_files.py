"""What a reader of the pages has in his folder beside a recording: films, targets, results, files of other programs."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from analysis.result.file import write
from recorder.importing.films import ImportOrder
from recorder.importing.run import Import
from rig.images.pixels import Stored
from tests.analysis.result.recordings import recording
from tests.analysis.targets.drawn import Drawing, DrawnCamera, frame_sheets, stations
from tests.photogrammetry.exchange.written import photomodeler_text, write_aicon, write_colmap, write_opencv
from tests.photogrammetry.synthetic import hill
from tests.recorder.importing.films import write_video
from tests.recorder.merging.test_merge import write_part
from tests.season.drawn import draw_season

_FRAMES: Final = 140
_FLASH: Final = 12


def write_films(folder: Path) -> None:
    """Small films, left, middle and right, each with a flash; and the rig file of the cameras that took them."""
    for name, late in (("left.avi", 0), ("middle.avi", 3), ("right.avi", 5), ("right.mp4", 5)):
        frames = [_grey(number, flash=number == _FLASH + late) for number in range(1, _FRAMES + 1)]
        codec = "mpeg4" if name.endswith(".mp4") else "ffv1"
        kind = "yuv420p" if name.endswith(".mp4") else "gray"
        write_video(folder / name, frames, codec=codec, stored=kind)
    cameras = "".join(
        f'[[cameras]]\nname = "{name}"\nbackend = "replay"\naddress = "none.mcap"\n'
        "region = { width = 64, height = 48 }\n"
        for name in ("K1", "K2", "K3")
    )
    (folder / "old-hill.toml").write_text(f'name = "old hill"\n[trigger]\nrate_hz = 50.0\n{cameras}')


def _grey(number: int, *, flash: bool) -> Stored:
    rows, columns = np.mgrid[:48, :64]
    return np.asarray((rows + columns + number) % 60 + 150 * flash, np.uint8)


def write_pictures_of_targets(folder: Path) -> None:
    """Five pictures of a frame of targets in a folder for each camera, and a log of them."""
    for name, seed in (("K1", 1), ("K2", 2), ("K3", 3)):
        drawing = Drawing(DrawnCamera((480, 360), 600.0, 4.0, -3.0, -2e-7), random=np.random.default_rng(seed))
        (folder / name).mkdir()
        poses = stations(np.array([0.0, 0.0, -200.0]), 1700.0, np.random.default_rng(seed), count=5)
        for number, pose in enumerate(poses, start=1):
            cv2.imwrite(str(folder / name / f"{number}.png"), drawing.picture(frame_sheets(), *pose))
    Import(ImportOrder([("K1", folder / "K1")], 1.0, folder / "recordings" / "target.mcap")).run()


def write_files_of_others(folder: Path) -> None:
    """A COLMAP model, calibrations of OpenCV, files of AICON, an export of PhotoModeler, surveyed balls."""
    (folder / "survey.json").unlink()  # the page makes it
    network = hill(1).network
    write_colmap(folder / "model", network)
    lens = np.array([-0.31, 0.22, 0.0013, -0.0007, 0.4])
    for name in ("K1", "K2", "K3"):
        matrix = np.array([[1420.0, 0.0, 325.5], [0.0, 1420.0, 231.25], [0.0, 0.0, 1.0]])
        write_opencv(folder / f"{name}.yml", matrix, lens)
    (folder / "balls.csv").write_text("name;X;Y;Z;sigma\nB1;0.523;-2.874;-1.871;0.012\nB2;1;2;3;0.02\n")
    lens_of_one = dict.fromkeys(("x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2", "r0"), 0.0)
    camera = {"c": 1420.0, **lens_of_one, "distortion": "projected", "size": [640, 480]}
    calibrated = {"format": "svev-adjustment/1", "converged": True, "cameras": {"K1": camera, "K2": camera}}
    (folder / "calibration.json").write_text(json.dumps(calibrated))
    written = {path.suffix: path for path in write_aicon(folder)}
    written[".ior"].rename(folder / "cameras.ior")
    (folder / "export.txt").write_text(photomodeler_text(network))


def write_two_logs(folder: Path) -> None:
    """Logs of one recording by two computers."""
    (folder / "jump.mcap").unlink()  # the page makes it
    for name, cameras in (("left", ["K1", "K2"]), ("right", ["K3"])):
        shutil.rmtree(folder / name)
        (folder / name).mkdir()
        write_part(folder / name / "jump.mcap", cameras, range(60))


def write_results(folder: Path) -> None:
    """Results of three days."""
    for name, given in (
        ("monday", recording(seed=1, jumps=2)),
        ("tuesday", recording(seed=2, leg_deg=2.0)),
        ("wednesday", recording(5, seed=3)),
    ):
        (folder / "results" / name).mkdir(parents=True)
        write(replace(given, recording=name), folder / "results" / name / "jumper.json")


def write_season(folder: Path) -> None:
    """A campaign of sixty logs that are measured already."""
    season = draw_season(folder, jumps=60, athletes=5, days=5)
    season.file.write_text(season.file.read_text() + "[cluster]\nworkers = 1\n")


def write_firewire_rig(folder: Path) -> None:
    """A rig of FireWire cameras, which are on the emulated bus."""
    rig = (folder / "config" / "rigs" / "sim-firewire.toml").read_text()
    (folder / "my-hill.toml").write_text(rig.replace("../scenarios/", "config/scenarios/"))


def write_own_hill(folder: Path) -> None:
    """The files that the page on a simulated hill of one's own shows, in their order."""
    page = (Path(__file__).parent.parent / "docs" / "tutorials" / "own-hill.md").read_text()
    shown = re.findall(r"```(?:toml|csv)\n(.*?)```", page, re.DOTALL)
    (folder / "my-hill").mkdir()
    for name, text in zip(("scenario.toml", "rig.toml", "cameras.toml", "balls.csv"), shown, strict=True):
        (folder / "my-hill" / name).write_text(text)
    apart = (folder / "config" / "rigs" / "sim.toml").read_text().partition("\n[network]\n")  # of tests beside this one
    rig = folder / "my-hill" / "rig.toml"
    rig.write_text(rig.read_text() + "".join(apart[1:]))


#: By the name of the page.
PREPARED: Final[dict[str, tuple[Callable[[Path], None], ...]]] = {
    "calibration": (write_pictures_of_targets,),
    "file-format": (write_two_logs,),
    "firewire": (write_firewire_rig,),
    "measuring": (write_films, write_results),
    "network-file": (write_files_of_others,),
    "own-hill": (write_own_hill,),
    "season": (write_season,),
}
