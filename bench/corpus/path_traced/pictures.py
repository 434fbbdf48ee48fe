"""Blender's pictures of a description, kept in the user's cache by its content: a scene is rendered once."""

import json
import os
import shutil
import subprocess
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from bench.corpus.path_traced.stage import WHITE
from rig.errors import BadInputError

_SCRIPT: Final = Path(__file__).parent / "in_blender.py"
_DEEPEST: Final = 65535.0


class Pictures:
    """The pictures of a description; what is missing is rendered.

    Args:
        told: the description (`bench.corpus.path_traced.stage`).

    Raises:
        BadInputError: Blender is missing, or fails.
    """

    def __init__(self, told: dict[str, Any]) -> None:
        self._folder = kept_in(told)
        self._shots = {shot["name"]: shot for shot in told["shots"]}
        if not all((self._folder / f"{name}.json").exists() for name in self._shots):
            _render(told, self._folder)

    def parts(self, shot: str) -> list[tuple[slice, slice, np.ndarray[Any, np.dtype[np.float32]]]]:
        """Rows, columns and radiance, 1 where it is white, of the parts that were rendered of a shot."""
        found = []
        for k, (left, top, right, bottom) in enumerate(self._shots[shot]["rectangles"]):
            path = self._folder / f"{shot}.{k}.png"
            read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            if read is None or read.dtype != np.uint16 or read.shape != (bottom - top, right - left):
                raise BadInputError(f"{path}: not the picture that was asked for: remove its folder")
            found.append((slice(top, bottom), slice(left, right), (read / (_DEEPEST * WHITE)).astype(np.float32)))
        return found

    def seen(self, shot: str) -> dict[str, float]:
        """By marker the share of its plate that the camera sees."""
        shares: dict[str, float] = json.loads((self._folder / f"{shot}.json").read_text(encoding="utf-8"))
        return shares


def kept_in(told: dict[str, Any]) -> Path:
    """The folder of the pictures of a description."""
    name = blake2b((json.dumps(told) + _SCRIPT.read_text(encoding="utf-8")).encode(), digest_size=12).hexdigest()
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "svev" / "path-traced" / name


def _render(told: dict[str, Any], folder: Path) -> None:
    blender = shutil.which("blender")
    if blender is None:
        raise BadInputError("path-traced pictures need Blender, which is missing: apt install blender")
    folder.mkdir(parents=True, exist_ok=True)
    description = folder / "description.json"
    description.write_text(json.dumps(told), encoding="utf-8")
    command = [blender, "-b", "--factory-startup", "--python-exit-code", "1", "--python", str(_SCRIPT)]
    with (folder / "blender.log").open("wb") as log:
        done = subprocess.run([*command, "--", str(description)], stdout=log, stderr=subprocess.STDOUT, check=False)
    if done.returncode:
        raise BadInputError(f"Blender failed with code {done.returncode}: see {folder / 'blender.log'}")
