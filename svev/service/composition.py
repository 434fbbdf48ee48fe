"""Puts the service together: supervisor thread, web server in the main thread, signals, systemd."""

import logging
import signal
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.catalogue import Catalogue
from recorder.events import Event, Level
from rig.errors import ProcessDiedError
from rig.preview import PreviewSlot
from rig.rigfile import load_rig
from rig.settings import RigSettings
from svev import console
from svev.backends import check_backends
from svev.service.data_lock import data_lock
from svev.service.event_hub import EventHub
from svev.service.journal import JournalHandler, write_line
from svev.service.listener import listen, url
from svev.service.notify import Notify
from svev.service.service import Service
from svev.service.supervisor import Supervisor
from webpanel.access import Access
from webpanel.app import create_app
from webpanel.server import PanelServer, make_server

_STOP_S: Final = 15.0
_TRASH_S: Final = 30 * 86400.0
#: Ctrl-C, systemd, a terminal or an ssh session that is closed.
_ENDINGS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True, slots=True)
class ServiceSettings:
    """What `svev serve` is told.

    Attributes:
        rig: rig file.
        data: folder for recordings; None: the rig file's.
        port: to listen on; 0: any.
        access: who may reach the panel, and on which address it listens.
        preroll_s: triplets kept while armed, s; None: the rig file's.
    """

    rig: Path
    data: Path | None
    port: int
    access: Access
    preroll_s: float | None


def serve(settings: ServiceSettings) -> None:
    """Run the service until SIGTERM or Ctrl-C; a recording in progress is finished.

    Raises:
        BadInputError: rig file, folder, address or port are no good, or another service uses them.
        ProcessDiedError: something did not come to an end in time.
    """
    rig, rig_toml = load_rig(settings.rig), settings.rig.read_text(encoding="utf-8")
    check_backends(rig)
    data = settings.data or rig.recorder.directory
    with ExitStack() as stack:
        stack.enter_context(data_lock(data))
        listener = stack.enter_context(listen(settings.access.host, settings.port))
        logging.basicConfig(level=logging.WARNING, handlers=[JournalHandler()])
        notify = stack.enter_context(closing(Notify()))
        hub, catalogue = EventHub(write_line), Catalogue(data)
        slot = stack.enter_context(closing(PreviewSlot.create(rig.triplet_shape, len(rig.cameras))))
        supervisor = _supervisor(rig, rig_toml, data, hub, slot, settings.preroll_s)
        service = stack.enter_context(closing(Service(rig, rig_toml, catalogue, supervisor, hub, slot)))
        server = make_server(create_app(service, catalogue, settings.access))
        _purge(catalogue, hub)
        _run(supervisor, server, service, listener, notify)


def _supervisor(
    rig: RigSettings, rig_toml: str, data: Path, hub: EventHub, slot: PreviewSlot, preroll_s: float | None
) -> Supervisor:
    preroll = rig.recorder.preroll_s if preroll_s is None else preroll_s
    config = {"preroll_s": preroll, "preview": slot.fd, "directory": str(data)}
    return Supervisor(rig, rig_toml, data, hub, preroll_s=preroll, recorder=config, inherit=(slot.fd,))


def _purge(catalogue: Catalogue, hub: EventHub) -> None:
    if gone := catalogue.purge(_TRASH_S):
        hub.tell(Event.now(Level.INFO, "service", f"the trash is emptied of recordings older than 30 days: {gone}"))


def _run(
    supervisor: Supervisor, server: PanelServer, service: Service, listener: socket.socket, notify: Notify
) -> None:
    """Both threads, from the first turn to the last."""
    greeted = False

    def on_turn() -> None:
        nonlocal greeted
        if server.started and not greeted:
            greeted = True
            console.say(f"svev: panel at {url(listener)}")
            notify.ready()
        notify.status(f"{supervisor.status.state}: {supervisor.status.statement.text}")
        if supervisor.answering:
            notify.feed_watchdog()

    def on_end() -> None:
        server.should_exit = True

    supervisor.on_turn, supervisor.on_end = on_turn, on_end
    with _signals(server, supervisor, notify):
        supervisor.start()
        try:
            server.run(sockets=[listener])
        finally:
            service.close()
            supervisor.begin_stop()
            ended = supervisor.join(_STOP_S)
    if not ended:
        raise ProcessDiedError(f"the rig did not stop within {_STOP_S:g} s: its processes end by themselves")
    supervisor.close()
    if supervisor.failure is not None:
        raise supervisor.failure


@contextmanager
def _signals(server: PanelServer, supervisor: Supervisor, notify: Notify) -> Iterator[None]:
    """Within, signals end the service, properly, however often they come."""

    def end(*_: object) -> None:
        server.should_exit = True
        notify.stopping()
        supervisor.begin_stop()

    before = {number: signal.signal(number, end) for number in _ENDINGS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
