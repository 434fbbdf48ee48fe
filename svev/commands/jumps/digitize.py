"""`svev digitize`: measures a log by hand, in the browser."""

import signal
from contextlib import closing
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from analysis.cameras.source import Source, read_source
from analysis.digitizing.desks import Desks
from analysis.digitizing.files import DeskFiles
from recorder.log.beside import digitized_path, measured_path
from recorder.reading.info import info
from rig.errors import UnknownRecordingError
from rig.host.endings import ENDINGS
from svev import console
from svev.claims import listen, url
from svev.commands.logs.contents import LogPath
from svev.commands.networks.delivery import PosesOption, SurveyOption
from webpanel.digitizing_app import create_digitizing_app
from webpanel.door.access import Access
from webpanel.server import make_server


def digitize_command(
    log: LogPath,
    survey: SurveyOption = None,
    calibration: PosesOption = None,
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="port of the page; 0: any that is free")
    ] = 0,
    marks: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="folder for what is measured; beside the log if left out"),
    ] = None,
    landmarks: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="landmarks of your own (TOML); landmarks.toml beside the log if left out"),
    ] = None,
) -> None:
    """Measure a log by hand, in the browser: points and skis in all images at once, with their sigmas in space.

    Open the address that is printed in a browser on this computer. Every click is kept at once, in a folder beside the
    log; what the automatic measurement found (LOG.measured) is there to be corrected. Without --survey and
    --calibration only images can be measured, nothing in space. Ctrl-C ends it.

    Exit codes: 0 ended by a signal; 2 bad input.

    Example: svev digitize recordings/jump.mcap --survey survey.json
    """
    files = DeskFiles(log, marks or digitized_path(log), measured_path(log), landmarks)
    source: Source | None = None if survey is None and calibration is None else read_source(survey, calibration)
    recording = info(log).recording

    def find(wanted: str) -> DeskFiles:
        if wanted != recording:
            raise UnknownRecordingError(f"this measures {recording} alone: open the address that svev printed")
        return files

    with closing(Desks(find, lambda: source)) as desks, closing(listen("127.0.0.1", port)) as listener:
        desks.desk(recording).opening()  # a log or file of landmarks that is wrong is refused here, and not by the page
        page = f"/digitize.html?recording={quote(recording)}"
        server = make_server(create_digitizing_app(desks, Access.for_address("127.0.0.1"), page))

        def end(*_: object) -> None:
            server.should_exit = True

        for number in ENDINGS:
            signal.signal(number, end)
        console.say(f"svev: measure at {url(listener, 'http').rstrip('/')}{page}")
        server.run(sockets=[listener])
