"""The camera's sensor: exposes at triggers, signs the frames and sends them, one packet in each cycle.

All times follow from the time of the trigger, however late this process was scheduled: a frame carries the time at
which it should have been taken, its packets the cycles in which they should have been sent.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import NS_PER_S, NS_PER_US, HostNs, host_now
from rig.pulse import HillPulse
from simrig.firewire.camera.advanced import AdvancedRegisters
from simrig.firewire.camera.geometry import Readout
from simrig.firewire.camera.iidc import CommandRegisters
from simrig.firewire.isochronous import CycleTimer, Transmission
from simrig.firewire.loop import Loop
from simrig.images.painter import Painter
from simrig.world.faults import Fault, FaultKind, FaultPlan
from simrig.world.pulses import PULSE_WIDTH_NS, PulseTrain
from simrig.world.statistics import Counters

LINE_NS: Final = 63_500  #: read-out time of one line (Marlin manual)
TRIGGER_DELAY_NS: Final = 8_000  #: from the trigger's edge to the start of the integration, at most
FIRST_PACKET_NS: Final = 500_000  #: from the end of the exposure to the first packet
_LEVEL: Final = 1  # Trigger_Mode_1
#: Whether the camera transmits and whether it waits for triggers.
_HALTED: Final = (False, False)
_FREE: Final = (True, False)


@dataclass(frozen=True, slots=True)
class Line:
    """The sensor's connections.

    Attributes:
        train: the hill's trigger pulses.
        timer: the bus's clock.
        send: delivers a frame when its last packet has been sent.
        reset_bus: resets the bus.
    """

    train: PulseTrain
    timer: CycleTimer
    send: Callable[[Transmission], None]
    reset_bus: Callable[[], None]


class Sensor:
    """One camera's sensor and its frame memory.

    Args:
        loop: calls the sensor when something is due.
        line: its connections.
        painter: draws the images.
        faults: faults of this camera.
        command: settings.
        advanced: settings, counters in registers, signature.
        counters: the sensor counts here what it reports.
        at_top: whether the significant bits of 16-bit pixels are the highest ones.
    """

    def __init__(
        self,
        loop: Loop,
        line: Line,
        painter: Painter,
        faults: FaultPlan,
        command: CommandRegisters,
        advanced: AdvancedRegisters,
        counters: Counters,
        *,
        at_top: bool,
    ) -> None:
        self._at_top = at_top
        self._loop, self._line, self._painter, self._faults = loop, line, painter, faults
        self._command, self._advanced, self._counters = command, advanced, counters
        self._mode = _HALTED
        self._session = 0
        self._free: list[NDArray[np.uint8]] = []
        self._exposed = self._read_out = self._sent = HostNs(0)

    def settings_changed(self) -> None:
        """Settings were written: if they switch transmission or trigger, drop the frames under way."""
        mode = self._command.transmitting, self._command.triggered
        if mode == self._mode:
            return
        self.halt()
        self._mode = mode
        if mode == _FREE:
            self._run_free(self._session, host_now())

    def halt(self) -> None:
        """Drop the frames under way and do nothing until `settings_changed`."""
        self._mode = _HALTED
        self._session += 1
        self._exposed = self._read_out = self._sent = HostNs(0)

    def pulse(self, pulse: HillPulse, time: HostNs) -> None:
        """The trigger input is high from `time` on, for `PULSE_WIDTH_NS`."""
        if not (self._command.transmitting and self._command.triggered):
            return
        faults = self._faults.take(pulse)
        kinds = {fault.kind for fault in faults}
        if FaultKind.BUS_RESET in kinds:
            self._line.reset_bus()
        if FaultKind.MISSED_PULSE in kinds:
            self._counters.missed += 1
            return
        edge = time if self._command.active_high else HostNs(time + PULSE_WIDTH_NS)
        session = self._session
        self._loop.at(edge, lambda: self._trigger(session, edge, pulse, faults))

    def software_trigger(self, time: HostNs) -> None:
        """Expose at a trigger by register, which the camera does not count."""
        if self._command.transmitting and self._command.triggered:
            self._expose(time, self._line.train.next_index(HostNs(time - 1)), ())

    def _trigger(self, session: int, time: HostNs, pulse: HillPulse, faults: tuple[Fault, ...]) -> None:
        if session != self._session:
            return
        self._counters.triggers += 1
        self._advanced.count_trigger()
        if any(fault.kind is FaultKind.OVERRUN for fault in faults):
            self._counters.overruns += 1
        else:
            self._expose(time, pulse, faults)

    def _run_free(self, session: int, time: HostNs) -> None:
        """Take frame after frame at the set rate, without triggers."""
        readout = self._command.readout
        if session != self._session or readout is None:
            return
        self._expose(time, self._line.train.next_index(HostNs(time - 1)), ())
        period = max(round(NS_PER_S / self._command.rate_hz), self._exposure_ns() + readout.height * LINE_NS)
        following = HostNs(time + period)
        self._loop.at(following, lambda: self._run_free(session, following))

    def _exposure_ns(self) -> int:
        if self._command.triggered and self._command.trigger_mode == _LEVEL:
            if self._command.active_high:
                return PULSE_WIDTH_NS
            return round(NS_PER_S / self._line.train.rate_hz) - PULSE_WIDTH_NS
        return self._advanced.exposure_us(self._command.shutter) * NS_PER_US

    def _expose(self, time: HostNs, pulse: HillPulse, faults: tuple[Fault, ...]) -> None:
        readout = self._command.readout
        if readout is None:
            return
        begin = HostNs(time + TRIGGER_DELAY_NS)
        end = HostNs(begin + self._exposure_ns())
        # Integration may overlap the read-out of the frame before, but not its integration; read-outs never overlap.
        if begin < self._exposed or end < self._read_out:
            self._counters.overruns += 1
            return
        self._exposed, self._read_out = end, HostNs(end + readout.height * LINE_NS)
        self._advanced.count_frame()
        data = self._draw(readout, begin, pulse)
        cycle, start = self._line.timer.next_cycle(HostNs(max(end + FIRST_PACKET_NS, self._sent)))
        frame = Transmission(
            self._command.channel, data, readout.packet_bytes, readout.packets, cycle, start,
            _lost_packets(faults, readout.packets), pulse,
        )  # fmt: skip
        self._sent = frame.end
        session = self._session
        self._loop.at(frame.end, lambda: self._finish(session, frame))

    def _draw(self, readout: Readout, begin: HostNs, pulse: HillPulse) -> NDArray[np.uint8]:
        """Draw a frame; returns its bytes, padding included."""
        size = readout.packets * readout.packet_bytes
        data = self._free.pop() if self._free else np.zeros(size, np.uint8)
        if len(data) != size:  # the format has changed
            self._free.clear()
            data = np.zeros(size, np.uint8)
        image = data[: readout.image_bytes].reshape(readout.height, -1)
        if readout.pixel_bytes == 1:
            self._painter.paint(image, readout.rows, readout.columns, pulse)
        else:
            self._painter.paint(image.ravel(), readout.rows, readout.columns, pulse, f"Mono{self._command.depth}")
            self._send_high_byte_first(image.view("<u2"))
        words = self._line.timer.register(begin), self._advanced.frames, self._advanced.triggers
        self._advanced.sign(image, words, readout.pixel_bytes)
        return data

    def _send_high_byte_first(self, image: NDArray[np.uint16]) -> None:
        """Turn the bytes of 16-bit pixels, whose significant bits AVT's cameras have at the top."""
        if self._at_top:
            np.left_shift(image, 16 - self._command.depth, out=image)
        image.byteswap(inplace=True)

    def _finish(self, session: int, frame: Transmission) -> None:
        """The last packet has been sent: deliver the frame and free its memory."""
        if session == self._session:
            self._line.send(frame)
            arrived = frame.packets - len(frame.lost)
            self._counters.packets += arrived
            self._counters.bytes += arrived * frame.packet_bytes
            if arrived:
                self._counters.frames += 1
                self._counters.last_packets.append((frame.pulse, frame.end))
        self._free.append(frame.data)


def _lost_packets(faults: tuple[Fault, ...], count: int) -> frozenset[int]:
    """Numbers, from 0, of the packets that faults take out of a frame of `count` packets."""
    lost: set[int] = set()
    for fault in faults:
        match fault.kind:
            case FaultKind.LOST_FRAME:
                lost.update(range(count))
            case FaultKind.LOST_LEADER:
                lost.add(0)
            case FaultKind.LOST_PACKETS:
                lost.update(packet - 1 for packet in fault.packets if packet <= count)
            case _:
                continue
    return frozenset(lost)
