"""Runs `svev serve`: supervisor in one thread, web server in the main thread, signals and systemd beside them."""

import logging
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from analysis.digitizing.desks import Desks
from analysis.digitizing.files import DeskFiles
from recorder.catalogue.entry import unlisted_logs
from recorder.catalogue.folder import Catalogue
from recorder.log.beside import digitized_path, measured_path
from recorder.log.write_lock import is_being_written
from recorder.publishing.keys import check_publication
from rig.api.jump import LastJump
from rig.api.status import ArmOrder
from rig.errors import ProcessDiedError, StateForbidsError
from rig.events import Event, Level
from rig.host.clock_doubt import clock_doubt
from rig.host.disk import free_bytes
from rig.host.endings import ENDINGS
from rig.phrase import Phrase, phrase, plain
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from rig.settings.webhook import WebhookSettings
from rig.transport.preview import PreviewSlot
from rig.transport.recorder_commands import RecorderOptions
from service.aiming.balls import BallPlaces
from service.alarms.messenger import Messenger
from service.alarms.occasions import Occasions
from service.calibrating.helper import CalibrationHelper
from service.calibrating.saving import CalibrationKeeper
from service.exports.jobs import Exports
from service.jumpers.book import JumperBook
from service.jumpers.keeper import Keeper
from service.lights import Lights
from service.measuring.queue import Measurings
from service.offloading.releasing import Removal
from service.parts import PartLimits
from service.processes.backends import check_backends
from service.processes.memory import check_memory
from service.recordings.measured_jumps import LogJudge, MeasuredJumps
from service.recordings.storage import usable_bytes
from service.recordings.trash_keeper import SteadyClock, TrashKeeper
from service.regions import Regions
from service.rehearsals import Rehearser
from service.service import Service
from service.status.event_hub import EventHub
from service.supervision.messages import JumpsKnown
from service.supervision.supervisor import Supervisor
from service.trains import Trains
from svev import console
from svev.claims import folder_claims, listen, url
from svev.serving.panel_doctor import PanelDoctor
from svev.serving.systemd import JournalHandler, Notify, write_line
from webpanel.app import create_app
from webpanel.door.access import Access
from webpanel.door.link_file import LinkFile
from webpanel.door.links import Links, kept_secret
from webpanel.door.logins import Sessions
from webpanel.door.session_file import SessionFile
from webpanel.door.tls import Tls
from webpanel.server import PanelServer, make_server

if TYPE_CHECKING:
    from analysis.cameras.source import Source

_STOP_S: Final = 15.0
_SOON_S: Final = 10.0
_HOUR_S: Final = 3600.0
#: At the end the disk gets so long to take the last login or logout.
_KEEP_S: Final = 1.0
#: The program that makes a rehearsal.
REHEARSE: Final = "svev.serving.rehearsal_program"
#: Ctrl-C, systemd, and a terminal or an ssh session that is closed.


@dataclass(frozen=True, slots=True)
class ServiceSettings:
    """The options of `svev serve`.

    Attributes:
        rig: rig file.
        data: folder for recordings; None: the rig file's.
        port: port to listen on; 0: any that is free.
        access: who may reach the panel, and at which address it listens.
        preroll_s: length of the pre-roll, s; None: the rig file's.
        tls: certificate of the panel; None: it speaks plain HTTP.
    """

    rig: Path
    data: Path | None
    port: int
    access: Access
    preroll_s: float | None
    tls: Tls | None = None


def serve(settings: ServiceSettings) -> None:
    """Run the service until SIGTERM or Ctrl-C; finish a recording in progress.

    Raises:
        BadInputError: rig file, folder, address or port cannot be used, or another service uses them.
        ProcessDiedError: a process did not end in time.
    """
    rig, rig_toml = load_rig(settings.rig), settings.rig.read_text(encoding="utf-8")
    check_backends(rig)
    data = settings.data or rig.recorder.directory
    preroll_s = rig.recorder.preroll_s if settings.preroll_s is None else settings.preroll_s
    check_memory(rig, preroll_s)
    check_publication(rig.network)
    with ExitStack() as stack:
        stack.enter_context(folder_claims(data, rig.recorder.fallback_directory, "svev serve", "--data"))
        listener = stack.enter_context(listen(settings.access.host, settings.port))
        logging.basicConfig(level=logging.WARNING, handlers=[JournalHandler()])
        notify = stack.enter_context(closing(Notify()))
        slot = stack.enter_context(closing(PreviewSlot.create(rig.triplet_shape, len(rig.cameras))))
        hub, catalogue = EventHub(write_line), stack.enter_context(closing(Catalogue(data, LogJudge())))
        jumps, options = MeasuredJumps(catalogue), RecorderOptions(directory=data, preroll_s=preroll_s, preview=slot.fd)
        jumpers = JumperBook(Keeper(data, hub.tell), hub.wake)
        supervisor = Supervisor(rig, rig_toml, hub, options, jumpers=jumpers)
        keeper = stack.enter_context(TrashKeeper(lambda: supervisor.rig, catalogue, hub.tell))
        exports = stack.enter_context(closing(_exports(rig, data, supervisor)))

        def in_use() -> tuple[RigSettings, str]:
            return supervisor.now.in_use.rig, supervisor.now.in_use.toml

        rehearser = stack.enter_context(closing(Rehearser(REHEARSE, in_use, data, hub.tell, hub.wake)))
        lights = Lights(supervisor, settings.rig, Regions(supervisor, settings.rig, preroll_s))
        trains = Trains(supervisor, settings.rig, preroll_s)
        balls = BallPlaces(lambda: supervisor.rig, data)
        service = Service(
            supervisor, jumpers, catalogue, exports,
            stack.enter_context(_measurings(data, supervisor, jumps, catalogue)), jumps,
            keeper, slot, rehearser, lights, trains, PartLimits(supervisor, settings.rig), balls,
            stack.enter_context(closing(_calibrating(settings.rig, data, supervisor, slot))),
            PanelDoctor(lambda: supervisor.rig, data).report,
        )  # fmt: skip
        server = make_server(
            create_app(
                service,
                settings.access,
                *_door(settings, rig, data, hub, stack),
                desks=stack.enter_context(closing(_desks(catalogue, supervisor))),
            ),
            settings.tls,
        )
        reporter = _Reporter(supervisor, server, notify, url(listener, "https" if settings.tls else "http"))
        supervisor.hooks.on_turn = reporter.report
        if rig.service.webhook is not None:
            messenger = stack.enter_context(Messenger(rig.service.webhook, hub.tell, service.recording))
            supervisor.hooks.on_turn = _telling(reporter.report, rig.service.webhook, messenger, service)

        def end() -> None:
            server.should_exit = True

        supervisor.hooks.on_end = end
        with _signals(server, supervisor, notify, catalogue):
            supervisor.start()
            try:
                _tell_of_folders(settings, rig, data, hub, exports)
                if settings.access.tokens.warning:
                    hub.tell(Event.now(Level.WARNING, "access", plain(settings.access.tokens.warning)))
                service.watch()
                if rig.service.arm_at_start:
                    service.arm(ArmOrder())
                server.run(sockets=[listener])
            finally:
                service.close()
                supervisor.stop(_STOP_S)
        if (failure := supervisor.now.loop.failure) is not None:
            raise failure


def _door(
    settings: ServiceSettings, rig: RigSettings, data: Path, hub: EventHub, stack: ExitStack
) -> tuple[Links, Sessions]:
    """The links that open single jumps on phones, and who has logged in; says if they end with the service."""

    def warn(said: Phrase) -> None:
        hub.tell(Event.now(Level.WARNING, "access", said))

    links = LinkFile(data, warn)
    secret, tokens = kept_secret(data, anew=links.broken), settings.access.tokens
    if secret.problem is not None:
        warn(secret.problem)
    file = SessionFile(data, tokens.mark(secret.value, b"svev sessions 1").hex(), warn)
    stack.callback(file.wait, _KEEP_S)
    return Links(secret.value, tokens, rig.service.share_hours * _HOUR_S, file=links), Sessions(file=file)


def _exports(rig: RigSettings, data: Path, supervisor: Supervisor) -> Exports:
    """The exports of the recordings, which leave the disk its reserve and stand still while a recording runs."""
    return Exports(data, supervisor.records, lambda: usable_bytes(rig, free_bytes(data) or 0))


def _calibrating(rig_file: Path, data: Path, supervisor: Supervisor, slot: PreviewSlot) -> CalibrationHelper:
    """Helps to calibrate the cameras with what the recorder leaves for people to look at."""
    keep = CalibrationKeeper(supervisor, rig_file)
    return CalibrationHelper(data, lambda: supervisor.rig, slot.fd, supervisor.records, keep)


def _measurings(data: Path, supervisor: Supervisor, jumps: MeasuredJumps, catalogue: Catalogue) -> Measurings:
    """Measures the logs of the recordings, and stands still while a recording runs."""

    def found(jumps: tuple[LastJump, ...]) -> None:
        with suppress(ProcessDiedError):  # the service ends; the result is on the disk
            supervisor.ask(partial(JumpsKnown, jumps=jumps), _SOON_S)

    earlier, hub = jumps.others_of_athlete, supervisor.hub
    removal = Removal(catalogue.delete, lambda: catalogue.trash().bytes, SteadyClock().trusted)
    busy = supervisor.records
    made = Measurings(data, lambda: supervisor.rig, busy, earlier, hub.tell, found, hub.wake, removal)
    supervisor.hooks.on_log = made.opened
    return made


def _desks(catalogue: Catalogue, supervisor: Supervisor) -> Desks:
    """Where recordings are measured by hand, from the survey or the poses that the rig file names."""

    def find(recording: str) -> DeskFiles:
        log = catalogue.file(recording)
        if is_being_written(log):
            raise StateForbidsError(f"recording {recording} is being made: stop it, then measure it")
        return DeskFiles(log, digitized_path(log), measured_path(log))

    def source() -> "Source | None":
        # Imported here because the analysis and its libraries take memory and half a second to load.
        from analysis.cameras.source import read_source  # noqa: PLC0415

        given = supervisor.rig.analysis
        if given is None or (given.survey is None and given.calibration is None):
            return None
        return read_source(given.survey, given.calibration)

    return Desks(find, source, supervisor.records)


def _telling(
    report: Callable[[], None], webhook: WebhookSettings, messenger: Messenger, service: Service
) -> Callable[[], None]:
    """What the supervisor does at every turn if there is a webhook: report, and tell those who are elsewhere."""
    occasions = Occasions(webhook.events)

    def turn() -> None:
        report()
        messenger.offer(occasions.look(service.status(), time.monotonic()))

    return turn


def _tell_of_folders(settings: ServiceSettings, rig: RigSettings, data: Path, hub: EventHub, exports: Exports) -> None:
    """Say if exports have no folder, logs cannot be listed, the date is doubtful, or --data overrides the rig file."""
    if (doubt := clock_doubt((settings.rig, *data.glob("*.mcap")))) is not None:
        hub.tell(Event.now(Level.WARNING, "clock", doubt))
    if exports.refused is not None:
        hub.tell(Event.now(Level.ERROR, "exports", exports.refused))
    if hidden := unlisted_logs(data):
        text = "{count} logs in {folder} are not listed, such as {name}: rename them, beginning with a letter or digit"
        said = phrase("event_unlisted", text, count=len(hidden), folder=str(data), name=hidden[0])
        hub.tell(Event.now(Level.WARNING, "service", said))
    named = rig.recorder.directory
    given = settings.data
    if given is None or "directory" not in rig.recorder.model_fields_set or given.resolve() == named.resolve():
        return
    text = "recordings go to {given} as --data says, not to {named} as {rig} says: remove --data, or recorder.directory"
    said = phrase("event_other_folder", text, given=str(given), named=str(named), rig=str(settings.rig))
    hub.tell(Event.now(Level.WARNING, "service", said))


class _Reporter:
    """Tells terminal and systemd how the service is; called at every turn of the supervisor.

    Args:
        supervisor: owns the rig.
        server: serves the panel.
        notify: reaches systemd.
        panel: address of the panel.
    """

    def __init__(self, supervisor: Supervisor, server: PanelServer, notify: Notify, panel: str) -> None:
        self._supervisor, self._server, self._notify, self._panel = supervisor, server, notify, panel
        self._greeted = self._complained = False

    def report(self) -> None:
        """Send what has changed, and feed the watchdog if all is well."""
        supervisor, notify = self._supervisor, self._notify
        if self._server.started and not self._greeted:
            self._greeted = True
            console.say_if_heard(f"svev: panel at {self._panel}")
            notify.ready()
        notify.status(f"{supervisor.status.state}: {supervisor.status.statement.text}")
        if supervisor.answering:
            notify.feed_watchdog()
        if notify.unsent and not self._complained:
            self._complained = True
            said = phrase("event_systemd", "systemd does not read its notification socket: it may restart svev")
            supervisor.hub.tell(Event.now(Level.WARNING, "service", said))


@contextmanager
def _signals(server: PanelServer, supervisor: Supervisor, notify: Notify, catalogue: Catalogue) -> Iterator[None]:
    """Within, signals end the service in order, however often they come; afterwards nothing disturbs its end."""

    def end(*_: object) -> None:
        server.should_exit = True
        notify.stopping()
        supervisor.begin_stop()
        catalogue.end_reading()

    for number in ENDINGS:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ENDINGS:
            signal.signal(number, signal.SIG_IGN)
