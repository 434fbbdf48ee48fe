"""One camera process: `python -m simrig.gige`.

The first line on standard input is the camera's configuration (`simrig.gige.config`), every further one a command,
each a JSON object; every line is answered by one JSON object on standard output, with `error` where it failed:

    {"command": "inject", "fault": {...}}   -> {}
    {"command": "statistics"}               -> {"statistics": {...}}
    {"command": "stop"}                     -> {}, and the process ends

When standard input ends, or the thread that started the process is gone, the process ends too.
"""

import ctypes
import json
import os
import signal
import sys
import threading
import traceback
from dataclasses import asdict
from typing import Any

from rig.errors import BadInputError
from rig.rigfile import validate
from simrig.faults import Fault
from simrig.gige import freeze
from simrig.gige.camera import Camera
from simrig.gige.config import CameraConfig

#: so that the thread that sends packets in time need not wait long for the one that renders
_SWITCH_INTERVAL_S = 0.0005
_PR_SET_PDEATHSIG = 1  # <linux/prctl.h>


def main() -> int:
    """Run one camera until told to stop.

    Returns:
        Exit code: 0 stopped, 2 bad configuration.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # the end of input alone does not end a frozen process
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for whoever started us
    threading.excepthook = _die
    freeze.watch()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    line = sys.stdin.readline()
    if not line:
        return 0
    try:
        camera = Camera(validate(CameraConfig, _object(line), "camera process"))
    except BadInputError as error:
        _answer({"error": str(error)})
        return error.exit_code
    camera.start()
    try:
        _answer({"pid": os.getpid()})
        _serve(camera)
    finally:
        camera.stop()
    return 0


def _serve(camera: Camera) -> None:
    """Obey commands until the stop command or the end of standard input."""
    for line in sys.stdin:
        try:
            command = _object(line)
            answer = _obey(camera, command)
        except BadInputError as error:
            answer, command = {"error": str(error)}, {}
        _answer(answer)
        if command.get("command") == "stop":
            return


def _obey(camera: Camera, command: dict[str, Any]) -> dict[str, Any]:
    match command:
        case {"command": "inject", "fault": dict() as fault}:
            camera.inject(validate(Fault, fault, "fault"))
            return {}
        case {"command": "statistics"}:
            return {"statistics": asdict(camera.statistics())}
        case {"command": "stop"}:
            return {}
        case _:
            raise BadInputError(f"command {command}: give inject, statistics or stop")


def _object(line: str) -> dict[str, Any]:
    try:
        data = json.loads(line)
    except json.JSONDecodeError as error:
        raise BadInputError(f"a line on standard input is no JSON ({error}); send one object per line") from None
    if not isinstance(data, dict):
        raise BadInputError("a line on standard input is no JSON object; send one object per line")
    return data


def _answer(data: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(data) + "\n")
    sys.stdout.flush()


def _die(failure: threading.ExceptHookArgs) -> None:
    """A camera that lost a thread must not look alive."""
    traceback.print_exception(failure.exc_type, failure.exc_value, failure.exc_traceback)
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
