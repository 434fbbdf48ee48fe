"""The panel over a real socket, on a thread of the test; and what every refusal must be."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import httpx

from analysis.cameras.source import read_source
from analysis.digitizing.desks import Desks
from analysis.digitizing.files import DeskFiles
from recorder.log.beside import digitized_path, measured_path
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from webpanel.app import create_app
from webpanel.door.access import Access
from webpanel.door.links import Links
from webpanel.door.tls import Tls
from webpanel.problems import Problem
from webpanel.server import PanelServer, make_server


@dataclass(frozen=True, slots=True)
class Panel:
    """A panel that answers at `host:port`."""

    host: str
    port: int
    service: MemoryService
    server: PanelServer
    desks: Desks

    @property
    def url(self) -> str:
        """Its address."""
        scheme = "https" if self.server.config.ssl_certfile else "http"
        return f"{scheme}://{self.host}:{self.port}"

    def client(self, **more: object) -> httpx.Client:
        """A client of its own; close it. Certificates are loaded (25 ms) only where there is one to check."""
        options = {"verify": self.url.startswith("https:"), **more}
        return httpx.Client(base_url=self.url, timeout=20, **options)  # type: ignore[arg-type]

    def connect(self) -> socket.socket:
        """A plain connection; close it."""
        return socket.create_connection((self.host, self.port), timeout=20)


def desks_of(service: MemoryService) -> Desks:
    """Where the recordings of the service are measured by hand, by its `survey`."""

    def find(recording: str) -> DeskFiles:
        log = service.catalogue.file(recording)
        return DeskFiles(log, digitized_path(log), measured_path(log))

    return Desks(find, lambda: None if service.survey is None else read_source(service.survey, None))


@contextmanager
def serving(
    service: MemoryService, access: Access, tls: Tls | None = None, links: Links | None = None
) -> Iterator[Panel]:
    """Serve meanwhile."""
    desks = desks_of(service)
    server = make_server(create_app(service, access, links, desks=desks), tls)
    listener = socket.create_server((access.host, 0))
    port = listener.getsockname()[1]
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, name="panel")
    thread.start()
    try:
        wait_until(lambda: server.started or not thread.is_alive(), "the panel answers")
        yield Panel(access.host, port, service, server, desks)
    finally:
        server.should_exit = True
        thread.join(20)
        desks.close()
        listener.close()
        service.exports.close()
    assert not thread.is_alive()
    wait_until(lambda: not _workers(), "the server's worker threads have ended")
    desks.close()  # what a request that was under way has opened meanwhile


def refused(answer: httpx.Response, status: int) -> Problem:
    """Check that an answer is a problem of this status, and return it."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = Problem.model_validate(answer.json())
    assert problem.status == status
    assert problem.title
    assert problem.code
    assert problem.detail
    assert "\n" not in problem.detail
    return problem


def _workers() -> list[threading.Thread]:
    """The threads in which handlers run; they end by themselves with their event loop."""
    return [thread for thread in threading.enumerate() if thread.name == "AnyIO worker thread"]
