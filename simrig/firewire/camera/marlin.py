"""An emulated AVT Marlin F-080B: a node of the bus, with its registers and its sensor.

With a GUID of Point Grey's it is a camera of theirs: the same sensor with other registers.
"""

import struct
from enum import IntEnum
from typing import Final

from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.firewire.camera import advanced, iidc
from simrig.firewire.camera.advanced import AdvancedRegisters, Signature
from simrig.firewire.camera.config_rom import COMMAND_BASE, camera_rom
from simrig.firewire.camera.geometry import Deep, bit
from simrig.firewire.camera.iidc import CommandRegisters, Register
from simrig.firewire.camera.point_grey import INQUIRIES, VENDOR_ID, PointGreyRegisters
from simrig.firewire.camera.sensor import Line, Sensor
from simrig.firewire.loop import Loop
from simrig.images.painter import Painter
from simrig.world.faults import OF_THE_CAMERA, ON_FIREWIRE, Fault, FaultPlan
from simrig.world.statistics import Counters

VENDOR: Final = "AVT"
MODEL: Final = "Marlin F080B"
POINT_GREY: Final = ("Point Grey Research", "Flea2 FL2-08S2M")
REGISTER_SPACE: Final = 0xFFFFF0000000  #: start of a node's initial register space
ROM: Final = 0x400
_QUADLET: Final = 4


class Rcode(IntEnum):
    """How a request to a node ended; those above 0xF are the kernel's own."""

    COMPLETE = 0x0
    TYPE_ERROR = 0x6
    ADDRESS_ERROR = 0x7
    GENERATION = 0x13
    NO_ACK = 0x14


class Tcode(IntEnum):
    """Kind of request to a node."""

    WRITE_QUADLET = 0
    WRITE_BLOCK = 1
    READ_QUADLET = 4
    READ_BLOCK = 5


#: Writes after which the extended shutter no longer holds.
_ENDS_EXTENDED_SHUTTER: Final = frozenset(
    {Register.CUR_V_FORMAT, Register.CUR_V_MODE, Register.CUR_V_FRM_RATE, Register.SHUTTER}
)


class Camera:
    """One camera.

    Args:
        guid: its GUID.
        loop: calls it when something is due.
        line: its sensor's connections.
        painter: draws its images.
        faults: its faults.
        signature: how it signs its images.
        deep: how it sends pixels of more than 8 bits.

    Attributes:
        counters: what it counts for its report.
        plugged: whether it is on the bus (and so has power).
        frozen: whether it is plugged in, but answers nothing and sends nothing.
    """

    def __init__(
        self,
        guid: int,
        loop: Loop,
        line: Line,
        painter: Painter,
        faults: FaultPlan,
        signature: Signature,
        deep: Deep,
    ) -> None:
        self.guid = guid
        point_grey = guid >> 40 == VENDOR_ID
        names = (*POINT_GREY, VENDOR_ID) if point_grey else (VENDOR, MODEL)
        self.rom = camera_rom(guid, *names)
        self.counters = Counters()
        self.plugged, self.frozen = True, False
        self._asked = HostNs(0)
        self._faults = faults
        self._command = CommandRegisters(self._written, deep.depth, INQUIRIES if point_grey else None)
        self._advanced = PointGreyRegisters() if point_grey else AdvancedRegisters(signature, deep.signed_bytes)
        self._sensor = Sensor(
            loop, line, painter, faults, self._command, self._advanced, self.counters, at_top=deep.at_top
        )

    @property
    def acquiring(self) -> bool:
        """Whether it exposes, at triggers or running free."""
        return self.plugged and self._command.transmitting

    def power_up(self) -> None:
        """Restart with default settings."""
        self._command.reset()
        self._advanced.reset()
        self._sensor.halt()

    def pulse(self, pulse: HillPulse, time: HostNs) -> None:
        """The trigger line rises at hill pulse `pulse`."""
        if not self.plugged:
            return
        if self.frozen:
            self.counters.missed += self._command.transmitting
            return
        self._sensor.pulse(pulse, time)

    def freeze(self) -> None:
        """Stop at once: answer nothing and send nothing."""
        self.frozen = True
        self._sensor.halt()

    def thaw(self) -> None:
        """Go on with the settings from before the freeze."""
        self.frozen = False
        self._sensor.settings_changed()

    def inject(self, fault: Fault) -> None:
        """Add a fault.

        Raises:
            BadInputError: its pulses are past, or it is no fault of single frames.
        """
        if fault.kind not in ON_FIREWIRE - OF_THE_CAMERA:
            raise BadInputError(f"fault {fault.kind} is none of a frame on FireWire: inject it into the SimulatedHill")
        self._faults.inject(fault)

    def request(self, tcode: int, offset: int, length: int, data: bytes, time: HostNs) -> tuple[Rcode, bytes]:
        """Carry out a read or write of consecutive quadlets.

        Args:
            tcode: kind of request.
            offset: address.
            length: bytes to read.
            data: bytes to write.
            time: when it came over the bus; all cameras get a broadcast at once.

        Returns:
            How it ended, and the data read.
        """
        if self.frozen:
            return Rcode.NO_ACK, b""
        self._asked = time
        place = offset - REGISTER_SPACE
        match tcode:
            case Tcode.READ_QUADLET | Tcode.READ_BLOCK:
                read = [self._read(place + step) for step in range(0, length, _QUADLET)]
                words = [word for word in read if word is not None]
                if len(words) < len(read):
                    return Rcode.ADDRESS_ERROR, b""
                return Rcode.COMPLETE, struct.pack(f">{len(words)}I", *words)
            case Tcode.WRITE_QUADLET | Tcode.WRITE_BLOCK:
                words = list(struct.unpack(f">{len(data) // _QUADLET}I", data))
                done = [self._write(place + _QUADLET * index, word) for index, word in enumerate(words)]
                return (Rcode.COMPLETE if all(done) else Rcode.ADDRESS_ERROR), b""
            case _:
                return Rcode.TYPE_ERROR, b""

    def _read(self, place: int) -> int | None:
        if 0 <= place - ROM < _QUADLET * len(self.rom):
            return self.rom[(place - ROM) // _QUADLET]
        if 0 <= place - COMMAND_BASE < iidc.SIZE:
            return self._command.read(place - COMMAND_BASE)
        mode, offset = divmod(place - iidc.FORMAT7_CSR, iidc.FORMAT7_SIZE)
        if 0 <= mode < len(self._command.format7_modes):
            return self._command.format7_modes[mode].read(offset)
        if 0 <= place - iidc.ADVANCED_BASE < advanced.SIZE:
            return self._advanced.read(place - iidc.ADVANCED_BASE)
        if isinstance(self._advanced, PointGreyRegisters):
            return self._advanced.read_command(place - COMMAND_BASE)
        return None

    def _write(self, place: int, value: int) -> bool:
        mode, offset = divmod(place - iidc.FORMAT7_CSR, iidc.FORMAT7_SIZE)
        if 0 <= place - COMMAND_BASE < iidc.SIZE:
            self._command.write(place - COMMAND_BASE, value)
        elif 0 <= mode < len(self._command.format7_modes):
            self._command.format7_modes[mode].write(offset, value)
        elif 0 <= place - iidc.ADVANCED_BASE < advanced.SIZE:
            self._advanced.write(place - iidc.ADVANCED_BASE, value)
        elif isinstance(self._advanced, PointGreyRegisters):
            return self._advanced.write_command(place - COMMAND_BASE, value)
        else:
            return False
        return True

    def _written(self, register: Register, value: int) -> None:
        """Act on a write to a command register."""
        if register in _ENDS_EXTENDED_SHUTTER:
            self._advanced.leave_extended_shutter()
        match register:
            case Register.INITIALIZE:
                self._advanced.reset()
                self._sensor.halt()
            case Register.ISO_EN | Register.TRIGGER_MODE:
                self._sensor.settings_changed()
            case Register.SOFTWARE_TRIGGER if value & bit(0):
                self._sensor.software_trigger(self._asked)
            case _:
                return
