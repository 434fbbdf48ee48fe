"""The panel with a rig in memory, to look at the page: `python -m tests.webpanel.serve --port 8123`."""

import argparse
import socket
import tempfile
from contextlib import closing
from pathlib import Path

from rig.frame import FrameStatus
from tests.recorder.logs import ALL_OK
from tests.webpanel.memory_service import MemoryService, write_recording
from webpanel.app import create_app
from webpanel.door.access import Access
from webpanel.server import make_server


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8123)
    parser.add_argument("--token-file", type=Path)
    options = parser.parse_args()
    access = Access.for_address(options.host, options.token_file)
    with (
        tempfile.TemporaryDirectory() as folder,
        socket.create_server((options.host, options.port)) as listener,
        closing(MemoryService(Path(folder))) as service,
    ):
        write_recording(Path(folder), "jump-1", (ALL_OK,) * 30, {"athlete": "Anna Berg", "bib": "17"})
        write_recording(Path(folder), "jump-2", ((FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK), *(ALL_OK,) * 29))
        make_server(create_app(service, access)).run(sockets=[listener])


if __name__ == "__main__":
    main()
