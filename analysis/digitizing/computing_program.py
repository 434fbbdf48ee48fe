"""The program that computes one jump from marks, started by `analysis.digitizing.computing`."""

import pickle
from pathlib import Path
from typing import Any

from analysis.procedure.steps import STEPS
from rig.background.program import Teller, serve
from rig.phrase import as_plain


def _compute(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Compute from the `order` (a pickled pair of measurements and source) and `log`, into the folder `out`.

    Says at the end what a page shows of it.
    """
    from analysis.digitizing.curves import curves_of  # noqa: PLC0415 - its libraries start their threads with our priority
    from analysis.procedure.analyze import analyze  # noqa: PLC0415
    from analysis.procedure.result_folder import write_folder  # noqa: PLC0415

    def progress(step: str, share: float) -> None:
        tell(last=share in {0.0, 1.0}, step=STEPS[step], share=share)

    log = Path(asked["log"])
    measurements, source = pickle.loads(Path(asked["order"]).read_bytes())  # noqa: S301 - the service wrote it just now
    found = analyze(log, source, by_hand=measurements, images=False, progress=progress)
    files = write_folder(found, log, Path(asked["out"]), progress=progress)
    return {
        "said": [as_plain(each) for jump in found.result.jumps for each in jump.verdict.said],
        "curves": {name: [point.model_dump() for point in curve] for name, curve in curves_of(found.result).items()},
        "files": sorted(file.name for file in files),
    }


if __name__ == "__main__":
    serve(_compute)
