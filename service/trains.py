"""The train of pulses, where svev makes it: stopped and started while armed, at another rate, kept in the rig file."""

from dataclasses import replace
from functools import partial
from pathlib import Path

from capture.iidc.configuration import READOUT_NS
from rig.api.trigger import TriggerChange, TriggerControl, TriggerView
from rig.clocks import NS_PER_US
from rig.errors import BadInputError, StateForbidsError
from rig.events import TRIGGER
from rig.phrase import phrase
from rig.settings.editing import with_rate, written_rate
from rig.settings.model import RigSettings
from service.processes.backends import check_backends
from service.processes.memory import check_memory
from service.rig_file import keep
from service.supervision.messages import Burst, ChangeRate, RunTrain
from service.supervision.supervisor import Supervisor
from triggering.sources.choice import trigger_source


class Trains:
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        rig_file: where the rate is kept.
        preroll_s: length of the pre-roll, whose memory grows with the rate.
    """

    def __init__(self, supervisor: Supervisor, rig_file: Path, preroll_s: float) -> None:
        self._supervisor, self._file, self._preroll_s = supervisor, rig_file, preroll_s
        self._kept_hz = supervisor.rig.trigger.rate_hz

    def view(self) -> TriggerView:
        """Who makes the pulses, and at what rate."""
        trigger = self._supervisor.rig.trigger
        return TriggerView(
            source=trigger.source,
            rate_hz=trigger.rate_hz,
            controls=tuple(sorted(trigger_source(trigger).controls)),
            running=self._supervisor.status.pulses.running,
            saved=trigger.rate_hz == self._kept_hz,
        )

    def change(self, change: TriggerChange) -> TriggerView:
        """Change the rate, and write it into the rig file if that is wished; stop or start the train.

        Raises:
            BadInputError: source, cameras or memory of this computer do not take the rate.
            StateForbidsError: a recording runs, the rig is being armed or disarmed, or others make the pulses.
            StorageError: the rig file cannot be written; the rate is changed all the same.
        """
        with self._supervisor.changing:
            self._check_made_here(TriggerControl.RATE)
            if change.running is not None:
                self._check_made_here(TriggerControl.RUNNING)
                self._supervisor.ask(partial(RunTrain, running=change.running))
            if change.rate_hz is not None and change.rate_hz != self._supervisor.rig.trigger.rate_hz:
                self._change_rate(change.rate_hz)
            if change.save:
                self._keep(self._supervisor.rig.trigger.rate_hz)
            return self.view()

    def burst(self, pulses: int) -> TriggerView:
        """Have so many pulses made, while the train stands still.

        Raises:
            StateForbidsError: it does not, the rig is not armed, a recording runs, or others make the pulses.
        """
        with self._supervisor.changing:
            self._check_made_here(TriggerControl.RUNNING)
            self._supervisor.ask(partial(Burst, pulses=pulses))
            return self.view()

    def _check_made_here(self, control: TriggerControl) -> None:
        rig = self._supervisor.rig
        controls = trigger_source(rig.trigger).controls
        if control in controls:
            return
        if controls:
            raise StateForbidsError(
                phrase(
                    "pulses_rate_only",
                    'with trigger.source = "{source}" only the rate can be changed: disarm to stop the pulses',
                    source=rig.trigger.source,
                )
            )
        if any(camera.backend == "replay" for camera in rig.cameras):
            raise StateForbidsError(
                phrase("rate_replayed", "the pulses are those of the replayed log: replay a log of another rate")
            )
        raise StateForbidsError(
            phrase(
                "rate_foreign",
                "a generator that svev does not drive makes the pulses (trigger.source = "
                '"{source}"): change its rate there and trigger.rate_hz in the rig file, then start '
                "the service again",
                source=rig.trigger.source,
            )
        )

    def _change_rate(self, rate_hz: float) -> None:
        supervisor = self._supervisor
        in_use = supervisor.now.in_use
        rig = with_rate(in_use.rig, rate_hz)
        trigger_source(rig.trigger)
        check_backends(rig)
        _check_dead_time(rig)
        check_memory(rig, self._preroll_s)
        new = replace(in_use, rig=rig, toml=written_rate(in_use.toml, rate_hz))
        said = phrase("event_rate", "is to make {rate_hz:g} pulses per second from now on", rate_hz=rate_hz)
        supervisor.change(partial(ChangeRate, new=new), TRIGGER, said)

    def _keep(self, rate_hz: float) -> None:
        by_hand = phrase("keep_rate", "write rate_hz = {rate_hz:g} under [trigger] into it", rate_hz=rate_hz)
        keep(self._file, lambda text: written_rate(text, rate_hz), by_hand)
        self._kept_hz = rate_hz


def _check_dead_time(rig: RigSettings) -> None:
    """Check that FireWire cameras have exposed and begun to send before the next pulse; of others it is not known.

    Raises:
        BadInputError: one has not.
    """
    for camera in rig.cameras:
        busy_ns = round(camera.exposure_us * NS_PER_US) + READOUT_NS
        if camera.backend == "iidc" and busy_ns >= rig.trigger.period_ns:
            raise BadInputError(
                phrase(
                    "rate_too_high",
                    "at {rate:g} Hz pulses would come every {every:.1f} ms, and exposure and readout of "
                    "camera {camera} take {busy:.1f} ms: choose a lower rate, or shorten its exposure "
                    "first",
                    rate=rig.trigger.rate_hz,
                    every=rig.trigger.period_ns / 1000000.0,
                    camera=camera.name,
                    busy=busy_ns / 1000000.0,
                )
            )
