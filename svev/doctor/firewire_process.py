"""Child process of the doctor: looks at FireWire cameras.

The rig comes on standard input; one finding goes on each line of standard output.
"""

import json
import sys
from dataclasses import asdict

from rig.settings import RigSettings
from svev.doctor.firewire_cameras import look_at_cameras
from svev.doctor.firewire_trial import try_camera


def main() -> None:
    """Look, and with `--trial` try every camera that is there and free."""
    rig = RigSettings.model_validate_json(sys.stdin.read())
    ready = []
    for finding, camera in look_at_cameras(rig):
        print(json.dumps(asdict(finding)), flush=True)  # noqa: T201 - standard output is the channel to the doctor
        if camera is not None:
            ready.append(camera)
    if "--trial" not in sys.argv[1:]:
        return
    for camera in ready:
        for finding in try_camera(camera, rig.trigger.rate_hz):
            print(json.dumps(asdict(finding)), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
