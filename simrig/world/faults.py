"""What goes wrong on the simulated hill: kinds of fault, one fault, and the faults that still await one camera.

Pulses are hill pulses (`simrig.world.pulses`), counted from 0, not the pulse numbers of a recording.
"""

import threading
from collections.abc import Iterable
from enum import StrEnum

from pydantic import Field, model_validator

from rig.errors import BadInputError
from rig.pulse import HillPulse
from rig.settings.strict_toml import StrictModel


class FaultKind(StrEnum):
    """Kinds of fault. The first seven befall single frames, the last four the camera or its bus."""

    MISSED_PULSE = "missed_pulse"  #: the camera does not see the pulse: no frame, no frame id, no trigger count
    OVERRUN = "overrun"  #: the pulse comes too soon after the one before: a trigger count, but no frame
    LOST_FRAME = "lost_frame"  #: the camera takes and counts the frame; no packet of it arrives, nor does a resend
    LOST_PACKETS = "lost_packets"  #: the named packets do not arrive
    LOST_LEADER = "lost_leader"  #: the first packet does not arrive (GigE Vision: leader; FireWire: first pixels)
    DAMAGED_FRAME = "damaged_frame"  #: the frame arrives, and the camera says that it is not whole
    TIMES_SLIP = (
        "times_slip"  #: times of frames are off by `slip_ms`, the clock that is read goes on (GigE Vision only)
    )
    FROZEN = "frozen"  #: the camera answers nothing and sends nothing for a while, then goes on
    RESTART = "restart"  #: the camera dies and comes back with default settings (FireWire: unplugged meanwhile)
    SLOW_LINK = "slow_link"  #: the cable carries only `mbit_s` for a while
    BUS_RESET = "bus_reset"  #: FireWire: the bus is reset when the camera sees the pulse


LASTING = frozenset({FaultKind.FROZEN, FaultKind.RESTART, FaultKind.SLOW_LINK})
#: Faults that befall the camera as a whole; `simrig.programs.simulated_hill` carries them out.
OF_THE_CAMERA = frozenset({FaultKind.RESTART, FaultKind.FROZEN})
#: Faults that a GigE Vision camera can have.
ON_GIGE = frozenset(FaultKind) - {FaultKind.BUS_RESET}
#: Faults that a FireWire camera can have: the bus sets the rate of its transfer, no packet reports damage, and the
#: bus's own clock times its frames.
ON_FIREWIRE = frozenset(FaultKind) - {FaultKind.SLOW_LINK, FaultKind.DAMAGED_FRAME, FaultKind.TIMES_SLIP}


class Fault(StrictModel):
    """One fault of one camera. A field that the kind has no use for is an error."""

    kind: FaultKind
    camera: str = Field(min_length=1, description="name of the camera")
    at_pulse: HillPulse | None = Field(None, ge=0, description="hill pulse, counted from 0; none: the next one")
    count: int = Field(1, ge=1, description="number of pulses in a row")
    packets: tuple[int, ...] = Field((), description="lost_packets: packet numbers, 1 = first one with pixels")
    resend: bool = Field(
        True, description="lost_packets, lost_leader: whether the camera resends them when asked (GigE Vision only)"
    )
    duration_s: float | None = Field(None, gt=0, le=3600, description="frozen, restart, slow_link: how long")
    mbit_s: float | None = Field(None, gt=0, description="slow_link: what is left of the link")
    slip_ms: float | None = Field(None, ge=-1000, le=1000, description="times_slip: by how much they are off")

    @model_validator(mode="after")
    def _fields_fit_kind(self) -> "Fault":
        kind = self.kind
        needed = {
            "packets": (bool(self.packets), kind is FaultKind.LOST_PACKETS),
            "duration_s": (self.duration_s is not None, kind in LASTING),
            "mbit_s": (self.mbit_s is not None, kind is FaultKind.SLOW_LINK),
            "slip_ms": (self.slip_ms is not None, kind is FaultKind.TIMES_SLIP),
        }
        for key, (given, wanted) in needed.items():
            if given != wanted:
                raise ValueError(
                    f'fault "{kind}" ' + (f"needs {key}: add it" if wanted else f"has no {key}: remove it")
                )
        if kind in LASTING and self.count != 1:
            raise ValueError(f'fault "{kind}" lasts for duration_s: remove count')
        if any(packet < 1 for packet in self.packets):
            raise ValueError("packets are counted from 1; use lost_leader for packet 0")
        return self

    @property
    def duration_ns(self) -> int:
        """Duration of a lasting fault, ns; 0 for the others."""
        return round((self.duration_s or 0.0) * 1e9)

    def hits(self, pulse: HillPulse) -> bool:
        """Whether this fault befalls hill pulse `pulse`; False while `at_pulse` is None."""
        return self.at_pulse is not None and self.at_pulse <= pulse < self.at_pulse + self.count


class FaultPlan:
    """The faults that still await one camera. Any thread may inject while another takes."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._lock = threading.Lock()
        self._pending: list[Fault] = list(faults)
        self._latest = -1

    def inject(self, fault: Fault) -> None:
        """Add a fault while the camera runs; `at_pulse` None means the next pulse.

        Raises:
            BadInputError: all its pulses are past.
        """
        with self._lock:
            if fault.at_pulse is not None and fault.at_pulse + fault.count - 1 <= self._latest:
                raise BadInputError(
                    f"fault {fault.kind} at pulse {fault.at_pulse}: pulse {self._latest} is past; name a later one"
                )
            self._pending.append(fault)

    def take(self, pulse: HillPulse) -> tuple[Fault, ...]:
        """Faults that befall hill pulse `pulse`. The camera calls this once per pulse, in ascending order.

        A fault whose pulses passed without a call (the camera was off) is dropped.
        """
        if not self._pending:  # the common case takes no lock
            self._latest = pulse
            return ()
        with self._lock:
            self._latest = pulse
            due = [f.model_copy(update={"at_pulse": pulse}) if f.at_pulse is None else f for f in self._pending]
            self._pending = [f for f in due if f.at_pulse is not None and f.at_pulse + f.count - 1 > pulse]
            return tuple(f for f in due if f.hits(pulse))
