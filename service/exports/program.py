"""The program that makes one export, started by `service.exports.jobs`."""

import zipfile
from pathlib import Path

from rig.api.export import ExportOrder
from rig.background.messages import End, Order
from rig.background.program import Teller, serve
from rig.transport.message import Message


class Export(Order):
    """Make this of a log, into the file `out`."""

    log: Path
    order: ExportOrder
    out: Path


class Exporting(Message):
    """So many of all pulses are done."""

    done: int
    pulses: int


class Exported(End):
    """The file has so many bytes."""

    bytes: int


def _export(asked: Export, tell: Teller) -> Exported:
    from analysis.film.export import export  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.film.whole import whole_file  # noqa: PLC0415

    def progress(done: int, pulses: int) -> None:
        tell(Exporting(done=done, pulses=pulses), last=done == pulses)

    out = asked.out
    if out.suffix != ".zip":
        export(asked.log, asked.order, out, progress)
    else:
        folder = out.with_suffix("")
        export(asked.log, asked.order, folder, progress)
        with whole_file(out) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for file in sorted(folder.rglob("*.*")):
                archive.write(file, file.relative_to(folder.parent))
                file.unlink()  # so that the pictures never need their room twice
    return Exported(bytes=out.stat().st_size)


def main() -> None:
    """Make one export."""
    serve({Export: _export})


if __name__ == "__main__":
    main()
