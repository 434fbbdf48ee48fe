"""The description of the REST API, without a rig: `python -m tests.support.rest_description FILE` writes it."""

import json
import sys
import tempfile
from pathlib import Path

from tests.webpanel.memory_service import MemoryService
from webpanel.app import create_app
from webpanel.door.access import Access


def write(target: Path) -> None:
    """Write what a service on loopback answers at `/openapi.json`."""
    with tempfile.TemporaryDirectory() as folder:
        app = create_app(MemoryService(Path(folder)), Access.for_address("127.0.0.1"))
        target.write_text(json.dumps(app.openapi()))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
