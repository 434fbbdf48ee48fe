"""A simulated camera at 127.0.0.1, and what the doctor says of it, as JSON on standard output."""

import json
import sys
import time
from pathlib import Path

from rig.clocks import host_now
from rig.settings.file import load_rig
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from svev.doctor.cameras.gige import look_at_cameras


def main() -> None:
    config = Path(sys.argv[1])
    camera = Camera(
        CameraConfig(
            name="K1", address="127.0.0.1", scenario=config / "scenarios" / "training.toml", rate_hz=30.0,
            epoch=host_now(), test_pattern=True, ptp_offset_ns=time.time_ns() - time.monotonic_ns(),
        )
    )  # fmt: skip
    rig = load_rig(config / "rigs" / "hill-gige.toml")
    rig = rig.model_copy(update={"cameras": (rig.cameras[0].model_copy(update={"address": "127.0.0.1"}),)})
    camera.start()
    try:
        found = [
            {"code": each.code, "level": each.level.value, "what": each.what, "remedy": each.remedy}
            for each in look_at_cameras(rig)
        ]
    finally:
        camera.stop()
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
