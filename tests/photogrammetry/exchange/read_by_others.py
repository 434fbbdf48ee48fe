"""Reads exported files by the programs that they are for; where each of them sees points in each camera.

`python read_by_others.py FOLDER`, with PYTHONPATH at what `make readers` has installed. In FOLDER are `colmap`, `toml`
and `points.json`. COLMAP writes its model again, into `txt` and `bin`. The last line of the output is JSON: image
points by program, a list for each camera.
"""

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
from caliscope.cameras.camera_array import CameraArray
from Pose2Sim.common import retrieve_calib_params

#: From COLMAP's origin of pixels, the corner of the picture, to the centre of the first one, px.
_CORNER = 0.5


def _projected(xyz: Any, rotation: Any, translation: Any, matrix: Any, lens: Any) -> Any:
    """Image points by OpenCV, with which the programs compute, by 3 x 3 rotation."""
    there = xyz @ rotation.T + np.ravel(translation)
    return cv2.projectPoints(there, np.zeros(3), np.zeros(3), matrix, lens)[0][:, 0]


def main() -> None:
    """See above."""
    folder = Path(sys.argv[1])
    xyz = np.array(json.loads((folder / "points.json").read_text()))
    model = pycolmap.Reconstruction(str(folder / "colmap"))
    images = sorted(model.images.values(), key=lambda image: image.name)
    seen = {"pycolmap": [[image.project_point(each) - _CORNER for each in xyz] for image in images]}
    for kind, write in (("bin", model.write_binary), ("txt", model.write_text)):
        (folder / kind).mkdir()
        write(str(folder / kind))
    told = retrieve_calib_params(folder / "toml" / "calibration.toml")
    seen["Pose2Sim"] = [
        _projected(xyz, *each) for each in zip(told["R_mat"], told["T"], told["K"], told["dist"], strict=True)
    ]
    array = CameraArray.from_toml(folder / "toml" / "camera_array.toml")
    seen["caliscope"] = [
        _projected(xyz, each.rotation, each.translation, each.matrix, each.distortions)
        for _, each in sorted(array.cameras.items())
    ]
    plain = {name: [np.array(camera).tolist() for camera in cameras] for name, cameras in seen.items()}
    sys.stdout.write(json.dumps(plain) + "\n")


if __name__ == "__main__":
    main()
