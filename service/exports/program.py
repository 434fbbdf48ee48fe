"""The program that makes one export, started by `service.exports.jobs`."""

import zipfile
from pathlib import Path
from typing import Any

from rig.api.export import ExportOrder
from rig.background.program import Teller, serve


def _export(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    from analysis.film.export import export  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.film.whole import whole_file  # noqa: PLC0415

    log, order, out = Path(asked["log"]), ExportOrder.model_validate(asked["order"]), Path(asked["out"])

    def progress(done: int, pulses: int) -> None:
        tell(last=done == pulses, done=done, pulses=pulses)

    if out.suffix != ".zip":
        export(log, order, out, progress)
    else:
        folder = out.with_suffix("")
        export(log, order, folder, progress)
        with whole_file(out) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for file in sorted(folder.rglob("*.*")):
                archive.write(file, file.relative_to(folder.parent))
                file.unlink()  # so that the pictures never need their room twice
    return {"bytes": out.stat().st_size}


if __name__ == "__main__":
    serve(_export)
