"""The program that orients the cameras of one log, started by `analysis.digitizing.orienting`."""

import pickle
from pathlib import Path
from typing import Any

from rig.background.program import Teller, serve
from rig.phrase import as_plain, plain


def _orient(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Orient the cameras of `log` by the `order`, a pickled pair of source and clicked balls (None: those in sight).

    The cameras are pickled into the file `answer`; says at the end what a person should know of them.
    """
    from analysis.cameras.frames import LogFrames  # noqa: PLC0415 - its libraries start their threads with our priority
    from analysis.digitizing.clicked_balls import orient_by_clicks  # noqa: PLC0415
    from analysis.procedure.log_facts import log_facts  # noqa: PLC0415
    from analysis.procedure.orienting import oriented  # noqa: PLC0415
    from analysis.scene.static_image import static_images  # noqa: PLC0415

    log = Path(asked["log"])
    source, marks = pickle.loads(Path(asked["order"]).read_bytes())  # noqa: S301 - the service wrote it just now
    tell(last=True)  # stands still here while a recording runs
    if marks is None:
        found = oriented(static_images(log), source, LogFrames(log))
        system = found.scene.system
        findings = [*map(plain, found.scene.messages), *(move.said for move in found.steadiness.moved)]
    else:
        sizes = {name: camera.size for name, camera in log_facts(log).cameras.items()}
        system, notes = orient_by_clicks(sizes, source, marks)
        findings = list(map(plain, notes))
    Path(asked["answer"]).write_bytes(pickle.dumps(system))
    return {"findings": [as_plain(finding) for finding in findings]}


if __name__ == "__main__":
    serve(_orient)
