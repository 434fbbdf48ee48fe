"""The camera's sensor: waits for triggers, exposes, and hands the frames to the transmitter.

Triggers of the hill and of scheduled actions are known in advance, so the sensor renders their image before they come.
A frame carries the time of its trigger, however late this process was scheduled.
"""

import heapq
import signal
import threading
from dataclasses import dataclass

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.pulse import HillPulse
from simrig.gige.imaging.camera_clock import CameraClock
from simrig.gige.imaging.frame_store import FrameStore, Shot, Slot
from simrig.gige.imaging.transmitter import Transmitter
from simrig.gige.registers.register_map import RegisterMap
from simrig.gige.registers.register_table import AcquisitionMode, ExposureMode, TriggerSource
from simrig.images.painter import Painter
from simrig.world.cable import CableEdge
from simrig.world.faults import Fault, FaultKind, FaultPlan
from simrig.world.pulses import PULSE_WIDTH_NS, PulseTrain
from simrig.world.statistics import Counters

LINE_NS = 5_000  #: read-out time of one line of the sensor
_LATE_NS = 5_000_000  # if a trigger is served later than this, the sensor checks whether the process was frozen
_STOP_S = 5.0
_IDS_16_BIT = 65535


def watch_for_freezes() -> None:
    """Let `Sensor` notice that this process was stopped (SIGSTOP) and continued: a frozen camera sees no pulses.

    The main thread must call this before it starts any other. SIGCONT continues a stopped process even where it is
    blocked, and then stays pending. So the sensor can find out why a trigger is late: frozen, or only scheduled late.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCONT})


def _was_frozen() -> bool:
    """Whether the process was stopped since the last call."""
    return signal.SIGCONT in signal.sigpending() and signal.sigtimedwait({signal.SIGCONT}, 0) is not None


@dataclass(frozen=True, slots=True)
class Trigger:
    """A moment at which the sensor shall begin to expose, and the hill pulse that the frame shall show."""

    time: HostNs
    pulse: HillPulse


@dataclass(frozen=True, slots=True)
class _Ahead:
    """An image rendered before its trigger."""

    store: FrameStore
    slot: Slot
    pulse: HillPulse


class Sensor:
    """A thread that exposes.

    Args:
        train: the hill's trigger pulses, which arrive at Line0 if there is no cable.
        faults: faults of this camera.
        painter: draws the images.
        clock: gives the timestamps.
        registers: the settings; those of the format are locked while the sensor acquires.
        transmitter: receives the frames.
        counters: the sensor counts triggers here.
        first_block_id: block id of the first frame after each start of acquisition.
        cable: edges that are told by `edge` arrive at Line0.

    Attributes:
        trigger_count: triggers seen while acquiring, since a controller last reset this count.
    """

    def __init__(
        self,
        train: PulseTrain,
        faults: FaultPlan,
        painter: Painter,
        clock: CameraClock,
        registers: RegisterMap,
        transmitter: Transmitter,
        counters: Counters,
        first_block_id: int,
        *,
        cable: bool = False,
    ) -> None:
        self._train, self._faults, self._painter, self._clock = train, faults, painter, clock
        self._registers, self._transmitter, self._counters = registers, transmitter, counters
        self._first_block_id, self._cable = first_block_id, cable
        self.trigger_count = 0
        self._condition = threading.Condition()
        self._stopping = False
        self._store: FrameStore | None = None  # None: not acquiring
        self._changes = 0
        self._since = HostNs(0)  # triggers up to here have been served or skipped
        self._pending: list[HostNs] = []  # software triggers, scheduled actions, edges of the cable, a heap
        self._busy_until = HostNs(0)
        self._ahead: _Ahead | None = None
        self._next_id = first_block_id
        self._latest_pulse = -1
        self._thread = threading.Thread(target=self._run, name="sensor")

    @property
    def acquiring(self) -> bool:
        """Whether the sensor exposes at triggers."""
        return self._store is not None

    @property
    def waiting_triggers(self) -> int:
        """Number of scheduled actions and software triggers that wait."""
        return len(self._pending)

    def start(self) -> None:
        """Start the thread; it does not acquire yet."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        with self._condition:
            self._stopping = True
            self._condition.notify_all()
        self._thread.join(_STOP_S)

    def acquire(self, store: FrameStore | None) -> None:
        """Begin to acquire into `store`, counting block ids anew; None: stop."""
        with self._condition:
            self._store = store
            self._registers.locked = store is not None
            self._next_id = self._first_block_id
            self._busy_until = HostNs(0)
            _was_frozen()
            self.settings_changed()

    def settings_changed(self) -> None:
        """Trigger settings were written: drop earlier triggers and use the new settings."""
        with self._condition:
            self._since = host_now()
            self._pending.clear()
            self._look_again()

    def trigger(self, source: TriggerSource, time: HostNs) -> None:
        """Take a software trigger or an action for a host time; ignored unless the settings select its source."""
        with self._condition:
            if self._source() is source:
                heapq.heappush(self._pending, time)
                self._look_again()

    def edge(self, edge: CableEdge) -> None:
        """Take an edge of the trigger cable; while the hill pauses, the cable is out."""
        with self._condition:
            begins = not self._registers.number("TriggerActivation")
            if edge.active == begins and self._train.nearest(edge.time) is not None:
                self.trigger(TriggerSource.LINE0, edge.time)

    def _look_again(self) -> None:
        self._changes += 1
        self._condition.notify_all()

    def _run(self) -> None:
        while True:
            with self._condition:
                trigger = self._next_trigger()
                while trigger is None and not self._stopping:
                    self._condition.wait()
                    trigger = self._next_trigger()
                if self._stopping or trigger is None:
                    return
                changes, store = self._changes, self._store
            self._render(store, trigger.pulse)
            with self._condition:
                while changes == self._changes and (early_ns := trigger.time - host_now()) > 0:
                    self._condition.wait(early_ns / NS_PER_S)
                if changes == self._changes:
                    self._serve(trigger)

    def _source(self) -> TriggerSource | None:
        """Selected source of triggers; None: the camera runs free."""
        if not self._registers.number("TriggerMode"):
            return None
        number = self._registers.number("TriggerSource")
        return TriggerSource(number) if number in set(TriggerSource) else TriggerSource.LINE1  # nothing comes in there

    def _next_trigger(self) -> Trigger | None:
        """The next trigger that is known; None if there is none."""
        if self._store is None:
            return None
        match self._source():
            case None:
                time = HostNs(max(self._since + self._free_period_ns(), self._busy_until, self._since + 1))
            case TriggerSource.LINE0 if not self._cable:
                delay = PULSE_WIDTH_NS if self._registers.number("TriggerActivation") else 0
                pulse = self._train.next_index(HostNs(self._since - delay))
                return Trigger(HostNs(self._train.time(pulse) + delay), pulse)
            case TriggerSource.LINE0 if self._pending and (shown := self._train.nearest(self._pending[0])) is not None:
                return Trigger(self._pending[0], shown)
            case TriggerSource.SOFTWARE | TriggerSource.ACTION0 if self._pending:
                time = self._pending[0]
            case _:
                return None
        return Trigger(time, self._train.next_index(HostNs(time - 1)))

    def _free_period_ns(self) -> int:
        if not self._registers.number("AcquisitionFrameRateEnable"):
            return 0  # as fast as the sensor can read out
        return round(NS_PER_S / self._registers.real("AcquisitionFrameRate"))

    def _exposure_ns(self) -> int:
        if self._registers.number("ExposureMode") == ExposureMode.TRIGGER_WIDTH:
            return PULSE_WIDTH_NS
        return round(self._registers.real("ExposureTime") * 1000)

    def _render(self, store: FrameStore | None, pulse: HillPulse) -> None:
        """Render the image of `pulse` into a free slot, if there is one."""
        ahead = self._ahead
        if store is None or (ahead is not None and ahead.store is store and ahead.pulse == pulse):
            return
        slot = ahead.slot if ahead is not None and ahead.store is store else store.take()
        if slot is not None:
            frame = store.format
            self._painter.paint(slot.image, frame.rows, frame.columns, pulse, frame.pixel_format)
            self._ahead = _Ahead(store, slot, pulse)

    def _serve(self, trigger: Trigger) -> None:
        """Expose, or miss, at `trigger`, whose moment has come. The caller holds the lock."""
        now = host_now()
        if now - trigger.time > _LATE_NS and _was_frozen():
            self._skip_to(now)
            return
        self._since = trigger.time
        if self._pending:
            heapq.heappop(self._pending)
        faults: tuple[Fault, ...] = ()
        if trigger.pulse > self._latest_pulse:  # a free-running camera may take several frames per pulse
            self._latest_pulse = trigger.pulse
            faults = self._faults.take(trigger.pulse)
        for fault in faults:
            if fault.kind is FaultKind.SLOW_LINK and fault.mbit_s is not None:
                self._transmitter.link.slow_down(fault.mbit_s, HostNs(trigger.time + fault.duration_ns))
        if any(fault.kind is FaultKind.MISSED_PULSE for fault in faults):
            self._counters.missed += 1
            return
        self._counters.triggers += 1
        self.trigger_count += 1
        ahead = self._ahead
        busy = trigger.time < self._busy_until or any(fault.kind is FaultKind.OVERRUN for fault in faults)
        if busy or ahead is None or ahead.pulse != trigger.pulse:
            self._counters.overruns += 1
            return
        self._expose(trigger, ahead, faults)

    def _skip_to(self, now: HostNs) -> None:
        """Count all triggers up to `now` as missed."""
        while (trigger := self._next_trigger()) is not None and trigger.time <= now:
            self._counters.missed += 1
            self._since = trigger.time
            if self._pending:
                heapq.heappop(self._pending)

    def _expose(self, trigger: Trigger, ahead: _Ahead, faults: tuple[Fault, ...]) -> None:
        frame = ahead.store.format
        ready = HostNs(trigger.time + self._exposure_ns())
        self._busy_until = HostNs(ready + frame.height * LINE_NS)
        modulus = 1 << 64 if frame.extended else _IDS_16_BIT
        block_id = (self._next_id - 1) % modulus + 1
        self._next_id = block_id + 1
        slip_ns = round(sum(fault.slip_ms or 0.0 for fault in faults) * 1e6)
        ticks = self._clock.exposure_ticks(HostNs(trigger.time + slip_ns), trigger.pulse)
        shot = Shot(ahead.slot, trigger.pulse, block_id, ticks, ready)
        _spoil(shot, faults)
        self._ahead = None
        self._transmitter.submit(ahead.store, shot)
        if self._registers.number("AcquisitionMode") == AcquisitionMode.SINGLE_FRAME:
            self._store, self._registers.locked = None, False
            self._changes += 1


def _spoil(shot: Shot, faults: tuple[Fault, ...]) -> None:
    """Apply faults of single frames to a frame."""
    everything = frozenset(range(shot.slot.table.count))
    for fault in faults:
        match fault.kind:
            case FaultKind.LOST_FRAME:
                lost, resend = everything, False
            case FaultKind.LOST_PACKETS:
                lost, resend = frozenset(fault.packets), fault.resend
            case FaultKind.LOST_LEADER:
                lost, resend = frozenset({0}), fault.resend
            case FaultKind.DAMAGED_FRAME:
                last = shot.slot.table.count - 2
                shot.damaged = frozenset(range(last - last // 4, last + 1))
                continue
            case _:
                continue
        shot.lost |= lost
        shot.gone |= frozenset() if resend else lost
