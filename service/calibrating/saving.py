"""Puts a calibration into the rig file, into the rig in use, and so into all logs from now on."""

import json
from functools import partial
from pathlib import Path
from typing import Final

from rig.host.disk import replace_file
from rig.phrase import phrase
from rig.settings.editing import with_calibration, written_calibration
from service.rig_file import keep, read_calibration
from service.supervision.messages import ChangeCalibration
from service.supervision.situation import RigInUse
from service.supervision.supervisor import Supervisor

_JOINED: Final = "joined.json"


class CalibrationKeeper:
    """Any thread may call it.

    Args:
        supervisor: owns the rig.
        rig_file: in which the calibration is named.
    """

    def __init__(self, supervisor: Supervisor, rig_file: Path) -> None:
        self._supervisor, self._file = supervisor, rig_file

    def __call__(self, result: Path) -> None:
        """Use a calibration from now on, also after a restart. Cameras that it lacks keep the one they had.

        Args:
            result: the result file.

        Raises:
            BadInputError: a camera has no calibration, neither in this file nor in the one before; or the rig file has
                become unreadable.
            StateForbidsError: a recording runs.
            StorageError: the rig file cannot be written; the logs have the calibration all the same.
        """
        supervisor = self._supervisor
        with supervisor.changing:
            cameras = frozenset(json.loads(result.read_bytes())["cameras"])
            cameras &= {camera.name for camera in supervisor.rig.cameras}
            file = self._with_others(result, cameras).resolve()
            rig = with_calibration(supervisor.rig, file, cameras)
            text = written_calibration(supervisor.now.in_use.toml, file, cameras)
            new = RigInUse(rig, text, read_calibration(rig))
            said = phrase("event_calibration", "is {file} from now on", file=str(file))
            supervisor.change(partial(ChangeCalibration, new=new), "calibration", said)
            by_hand = phrase("keep_calibration", 'write calibration = "{file}" at its top', file=str(file))
            keep(self._file, lambda text: written_calibration(text, file, cameras), by_hand)

    def _with_others(self, result: Path, cameras: frozenset[str]) -> Path:
        """The result file, or one beside it that has the other cameras of the calibration before, too."""
        from recorder.merging.calibration_file import Attached, joined_calibration  # noqa: PLC0415 - seldom needed

        before = self._supervisor.rig.calibration
        others = [camera.name for camera in self._supervisor.rig.cameras if camera.name not in cameras]
        if before is None or not others:
            return result
        parts = (
            Attached(before.name, others, before.read_bytes()),
            Attached(result.name, list(cameras), result.read_bytes()),
        )
        joined = result.with_name(_JOINED)
        replace_file(joined, joined_calibration(parts) or b"", links=False)
        return joined
