"""The main loop of the recorder process: reads the rings, obeys commands, writes and publishes, reports.

The commands are `rig.transport.recorder_commands.RecorderCommand`, the reports `RecorderReport`.
"""

import os
import select
from collections import deque
from collections.abc import Iterator
from typing import Final

from recorder.live.assembler import Assembler, in_flight_triplets
from recorder.live.composer import Triplet
from recorder.live.health import HealthMonitor
from recorder.live.preroll import Preroll, preroll_triplets
from recorder.live.recordings import Recordings
from recorder.log.mcap_layout import SlotLayout
from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.keys import check_publication, load_keys
from recorder.publishing.publisher import Publisher
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import SvevError
from rig.events import TRIGGER, Event, Level
from rig.health import PairingHealth
from rig.host.utc_clock import SetClock
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.transport import wire
from rig.transport.channel import ControlChannel
from rig.transport.message import Quit
from rig.transport.preview import PreviewSlot
from rig.transport.recorder_commands import (
    GrabberDied,
    PulsesFired,
    RecorderCommand,
    RecorderConfig,
    StartRecording,
    StopRecording,
    TellActions,
    TellEvent,
    TellPulses,
    TellResult,
)
from rig.transport.recorder_reports import (
    CameraChanged,
    RecorderEvent,
    RecorderFailed,
    RecorderHealth,
    RecorderReady,
    RecorderReport,
    RecorderWarm,
)
from rig.transport.ring import CameraRing
from triggering.alarms.notices import SpreadTeller
from triggering.pairing.pairer import ClosedPulse
from triggering.sources.choice import trigger_source
from triggering.timeline.steady_rate import steady_rate

_REPORT_EVERY_NS: Final = NS_PER_S // 5
_PRESSING_NS: Final = NS_PER_S // 1000
_WARM_PULSES: Final = 3
#: Their rate is measured from so many, and told again; at first from those that there are.
_RATE_PULSES: Final = 17
#: How long the recorder waits for the disk when it is told to quit; less than its parent waits for its end.
_WIND_UP_S: Final = 6.0


class _WarmUp:
    """Whether all cameras see the same pulses, which whole triplets in a row show, and how fast these come."""

    def __init__(self) -> None:
        self._whole = 0
        self._times: deque[HostNs] = deque(maxlen=_RATE_PULSES)

    def add(self, pulse: ClosedPulse) -> RecorderWarm | None:
        """Take in the next pulse; returns the report that is due, seldom one."""
        self._whole = self._whole + 1 if pulse.complete else 0
        self._times.append(pulse.time)
        if self._whole not in {_WARM_PULSES, _RATE_PULSES}:
            return None
        rate = steady_rate(self._times)
        return RecorderWarm() if rate is None else RecorderWarm(rate_hz=rate.hz, rate_error=rate.error)


class _Warnings:
    """What people are warned of once a second: pulses too far apart, dropped reports, refused subscribers, a set clock.

    Args:
        rig: the rig.
        control: channel to the service process.
        publisher: has the subscribers.
    """

    def __init__(self, rig: RigSettings, control: ControlChannel[RecorderCommand], publisher: Publisher) -> None:
        self._control, self._publisher = control, publisher
        self._spread, self._set_clock = SpreadTeller(trigger_source(rig.trigger)), SetClock()
        self._unreported = 0

    def due(self, pairing: PairingHealth) -> Iterator[tuple[str, Phrase]]:
        """What has happened in the last second, each with the name of the part that it concerns."""
        if (said := self._spread.tell(pairing)) is not None:
            yield TRIGGER, said
        dropped, self._unreported = self._control.dropped - self._unreported, self._control.dropped
        if dropped:
            why = "{count} reports are dropped: the service process does not read them; see whether it is stopped"
            yield "recorder", phrase("event_reports_dropped", why, count=dropped)
        for fault, count in self._publisher.refused().items():
            what = "{count} connections are closed, of a program that {fault}: end it, or publish on another address"
            yield "publisher", phrase("event_subscribers_refused", what, count=count, fault=fault)
        if moved_s := self._set_clock.moved_s():
            text = "the computer's clock was set by {seconds:+.3f} s, or it was suspended; the times in the log go on"
            yield "computer", phrase("event_clock_set", text, seconds=moved_s)


class RecorderLoop:
    """Owns the triplet buffers, the assembler, the publisher and the recordings.

    Args:
        config: first message of the service process.
        control: channel to the service process.
    """

    def __init__(self, config: RecorderConfig, control: ControlChannel[RecorderCommand]) -> None:
        rig, network, options = config.rig, config.rig.network, config.options
        rings = [CameraRing(fd) for fd in config.rings]
        self._doorbell, self._control = config.doorbell, control
        self._preview = None if options.preview is None else PreviewSlot(options.preview)
        in_flight, topics = in_flight_triplets(rig), rig.own_topics()
        slot_bytes = SlotLayout(rig.triplet_shape, topics, rig.pixels).slot_bytes
        held = preroll_triplets(rig, options.preroll_s, slot_bytes)
        buffers = TripletBuffers(rig.triplet_shape, in_flight + held, topics, rig.pixels)
        self._assembler = Assembler(rig, rings, buffers, config.epoch)
        keys = None if network.curve_key_file is None else load_keys(network.curve_key_file)
        self._publisher = Publisher(network.publish, network.publish_ipc, queue=in_flight // 4, keys=keys)
        self._preroll = Preroll(buffers, options.preroll_s, held)
        self._health = HealthMonitor(rig, rings, options.directory)
        self._recordings = Recordings(
            self._assembler, self._preroll, self._publisher, self._health.latency, self._health.underruns, self._tell
        )
        self._warm_up, self._warnings = _WarmUp(), _Warnings(rig, control, self._publisher)
        now = host_now()
        self._next_report, self._next_health = now, HostNs(now + NS_PER_S)

    def run(self) -> None:
        """Work until told to quit or until the service process is gone; then finish the recording."""
        rig = self._assembler.rig
        if self._preview is not None:
            self._preview.take_over(rig.triplet_shape)
        self._tell(RecorderReady())
        if exposed := check_publication(rig.network):
            self._warn("publisher", exposed)
        poll = select.poll()
        poll.register(self._doorbell, select.POLLIN)
        poll.register(self._control, select.POLLIN)
        quits = self._obey_waiting()  # commands that came together with the configuration ring no bell
        while not quits:
            ready = {fd for fd, _ in poll.poll(self._sleep_ms(host_now()))}
            if self._doorbell in ready:
                os.eventfd_read(self._doorbell)
            if self._control.fileno() in ready:
                quits = self._obey_waiting() or self._control.ended
            self._step(host_now())
        gone = phrase("why_service_gone", "the service process is gone")
        self._recordings.wind_up(
            gone if self._control.ended else phrase("why_told_to_quit", "told to quit"), _WIND_UP_S
        )
        self._publisher.close()
        self._health.close()
        self._assembler.buffers.close()

    def _step(self, now: HostNs) -> None:
        self._control.flush()
        for triplet in self._assembler.pump(now):
            self._take_in(triplet, now)
        for change in self._assembler.cameras.changes():
            self._camera_changed(change)
        for limits in self._assembler.cameras.limits():
            self._tell(limits)
        self._recordings.work(now)
        if now >= self._next_report:
            self._next_report = HostNs(now + _REPORT_EVERY_NS)
            self._recordings.progress()
        if now >= self._next_health:
            self._next_health = HostNs(now + NS_PER_S)
            self._tell_health(now)

    def _take_in(self, triplet: Triplet, now: HostNs) -> None:
        """Measure a decided pulse, show it as preview if one is due, and pass it on to the recordings."""
        self._health.pulse(triplet.pulse)
        if self._preview is not None and self._preview.due(now):
            pixels = None if triplet.slot is None else self._assembler.buffers.pixels(triplet.slot)
            statuses = [outcome.status for outcome in triplet.pulse.outcomes]
            bits = self._assembler.rig.pixels.bits
            self._preview.write(triplet.pulse.number, triplet.pulse.time, statuses, pixels, now, bits)
        if not self._recordings.running and (warm := self._warm_up.add(triplet.pulse)) is not None:
            self._tell(warm)
        self._recordings.take(triplet)

    def _obey_waiting(self) -> bool:
        """Obey the commands that have come; returns whether one says to quit."""
        commands = self._control.receive(0)
        for command in commands:
            self._obey(command)
        return any(isinstance(command, Quit) for command in commands)

    def _obey(self, command: RecorderCommand) -> None:
        match command:
            case StartRecording():
                try:
                    self._recordings.start(command)
                except SvevError as error:
                    self._tell(RecorderFailed.of(error))
            case StopRecording():
                self._recordings.stop(at_once=command.at_once, keep=command.keep)
            case GrabberDied():
                self._assembler.cameras.disconnected(command.camera, command.reason, host_now())
            case TellEvent():
                self._recordings.happened(command.event)
            case PulsesFired():
                for number, time in enumerate(command.times, start=command.first):
                    self._assembler.pairer.fired(number, time, command.uncertainty_ns)
                self._assembler.pairer.fired_until(command.until)
                self._health.fired(command.told())
            case TellResult():
                self._recordings.result(command)
            case TellActions():
                self._health.actions = command.counts
            case TellPulses():
                self._health.made = command.made
            case Quit():
                pass

    def _camera_changed(self, change: CameraChanged) -> None:
        self._tell(change)
        name = self._assembler.rig.cameras[change.camera].name
        self._recordings.happened(change.event(name))

    def _tell_health(self, now: HostNs) -> None:
        """Report, publish and write the health record of the last second."""
        health = self._health.record(
            now,
            self._assembler.cameras.connected,
            pairing=self._assembler.pairer.health(),
            free_triplets=self._assembler.buffers.free_count,
            unpublished=self._publisher.dropped,
            preroll=self._preroll.health(now),
            recording=self._recordings.statistics(),
        )
        self._tell(RecorderHealth(health=health))
        for name, said in self._warnings.due(health.pairing):
            self._warn(name, said)
        self._recordings.health(wire.encode(health))

    def _warn(self, name: str, said: Phrase) -> None:
        """Tell people at once, and write it into the log."""
        event = Event.now(Level.WARNING, name, said)
        self._tell(RecorderEvent(event=event))
        self._recordings.happened(event)

    def _sleep_ms(self, now: HostNs) -> float:
        deadlines = [self._next_report, self._next_health]
        if (undecided := self._assembler.pairer.next_deadline()) is not None:
            deadlines.append(undecided)
        if self._assembler.backlog or self._recordings.pressing:
            deadlines.append(HostNs(now + _PRESSING_NS))
        return max(0.0, (min(deadlines) - now) / 1e6)

    def _tell(self, report: RecorderReport) -> None:
        self._control.send(report)
