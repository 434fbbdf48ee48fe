"""The settings of the trigger: who makes the pulses. One class for each source; `[trigger] source` names it."""

from ipaddress import IPv4Address
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from rig.settings.strict_toml import StrictModel

#: A command to expose begins so late at most, as a share of the period, or it is not given at all.
_LATEST: Final = 0.1
#: It may be so long on its way, or its moment is not known.
_LONGEST: Final = 0.1
#: So many scheduled actions may wait in every camera: the fewest that a maker names (Opto Engineering Itala).
_ACTION_QUEUE: Final = 4


#: A line of a GPIO chip, by number or name.
GpioLine = Annotated[int, Field(ge=0, le=1023)] | Annotated[str, Field(min_length=1, max_length=31)]


def _ipv4(text: str) -> str:
    return str(IPv4Address(text))


class TriggerSettings(StrictModel):
    """What all sources have in common."""

    rate_hz: float = Field(30.0, ge=0.1, le=1000, description="pulses per second")
    settle_s: float = Field(5.0, gt=0, le=120, description="wait at most this long for the first pulses")
    min_cameras: int | None = Field(
        None, ge=1, le=8, description="with fewer cameras than this the rig is not armed; left out: all of them"
    )
    gated: bool = Field(
        False, description="pulses come at times only, e.g. when a jumper starts: that they stop is no alarm"
    )

    @property
    def period_ns(self) -> int:
        """Nominal time between two pulses, ns."""
        return round(1e9 / self.rate_hz)

    @property
    def pauses(self) -> bool:
        """Whether pulses may stop at any time and nothing is wrong."""
        return self.gated


class ExternalTrigger(TriggerSettings):
    """A pulse generator, whose cable leads to all cameras: the edge of a pulse exposes all at the same instant."""

    source: Literal["external"] = Field("external", description="a generator that svev knows nothing of")


class CommandedTrigger(TriggerSettings):
    """What sources have in common whose pulses are commands from this computer."""

    @property
    def latest_ns(self) -> int:
        """A command that would begin later than this after its pulse is not given, ns."""
        return round(_LATEST * self.period_ns)

    @property
    def longest_ns(self) -> int:
        """The longest way of a command for which its moment counts as known, ns."""
        return round(_LONGEST * self.period_ns)


class SoftwareTrigger(CommandedTrigger):
    """Commands from this computer, one to each camera for each pulse: without a cable, for set-up only."""

    source: Literal["software"] = Field(description="commands to each camera, for set-up only")


class ActionTrigger(CommandedTrigger):
    """GigE Vision action commands: the pulse comes by the network, and PTP makes it as exact as one by cable."""

    source: Literal["action"] = Field(description="GigE Vision action commands over the network")
    broadcast: tuple[Annotated[str, AfterValidator(_ipv4)], ...] = Field(
        (),
        max_length=8,
        description="broadcast address of each network with cameras, e.g. 192.168.8.255: one command exposes them all; "
        "left out: each camera gets a command of its own",
    )
    scheduled: bool = Field(
        False, description="cameras expose at a time of their PTP clocks, not when the command comes: they need PTP"
    )
    lead_ms: float = Field(10.0, gt=0, le=1000, description="scheduled commands are sent so long before their time")

    @property
    def lead_ns(self) -> int:
        """The same, ns."""
        return round(self.lead_ms * 1e6)

    @model_validator(mode="after")
    def _cameras_hold_the_scheduled(self) -> "ActionTrigger":
        waiting = self.lead_ms / 1000 * self.rate_hz
        if self.scheduled and waiting > _ACTION_QUEUE:
            most = 1000 * _ACTION_QUEUE / self.rate_hz
            raise ValueError(
                f"trigger.lead_ms = {self.lead_ms:g} has cameras hold {waiting:.0f} commands at {self.rate_hz:g} Hz, "
                f"and some hold only {_ACTION_QUEUE}: make it {most:g} or less"
            )
        return self


class GateSettings(StrictModel):
    """An input of the same chip from outside, e.g. of a start gate: pulses are made only while it is active."""

    line: GpioLine = Field(description="line of the gate: its number on the chip, or its name (gpioinfo)")
    active_low: bool = Field(False, description="pulses are made while the line is low")


class GpioTrigger(TriggerSettings):
    """A line of this computer: its cable leads to all cameras, and a process of svev makes the pulses."""

    source: Literal["gpio"] = Field(description="a line of this computer, set through libgpiod")
    chip: str = Field(
        "gpiochip0", min_length=1, max_length=200, description="GPIO chip: device file, number, or label (gpiodetect)"
    )
    line: GpioLine = Field(description="line of the pulses: its number on the chip, or its name (gpioinfo)")
    active_low: bool = Field(False, description="the line is low during a pulse")
    pulse_ms: float = Field(1.0, ge=0.05, le=100, description="length of a pulse; at most half of the period")
    gate: GateSettings | None = Field(None, description="pulses are made only while another line is active")

    @property
    def lines(self) -> tuple[int | str, ...]:
        """The lines of the chip that are needed, as they are named."""
        return (self.line,) if self.gate is None else (self.line, self.gate.line)

    @property
    def pauses(self) -> bool:
        """See `TriggerSettings.pauses`; the gate closes when somebody outside likes."""
        return self.gated or self.gate is not None

    @property
    def width_ns(self) -> int:
        """Length of a pulse, ns."""
        return round(self.pulse_ms * 1e6)

    @model_validator(mode="after")
    def _gate_is_another_line(self) -> "GpioTrigger":
        if self.gate is not None and self.gate.line == self.line:
            raise ValueError(f"trigger.gate.line = {self.line!r} is the line of the pulses: name another one")
        return self

    @model_validator(mode="after")
    def _pulses_end(self) -> "GpioTrigger":
        if 2 * self.width_ns > self.period_ns:
            raise ValueError(
                f"trigger.pulse_ms = {self.pulse_ms:g} is more than half of the time between two pulses at "
                f"{self.rate_hz:g} Hz: make it {self.period_ns / 2e6:.3g} or less"
            )
        return self


class IidcBroadcastTrigger(TriggerSettings):
    """Commands to all FireWire cameras of a bus at once: one write to their software trigger registers (IIDC 1.31)."""

    source: Literal["iidc-broadcast"] = Field(description="one command to all FireWire cameras of a bus")

    @property
    def width_ns(self) -> int:
        """A command has no length, ns."""
        return 0


class BarrierSettings(StrictModel):
    """A light barrier on an input line of this computer; each edge to active is a mark."""

    chip: str = Field(
        "gpiochip0", min_length=1, max_length=200, description="GPIO chip: device file, number, or label (gpiodetect)"
    )
    line: GpioLine = Field(description="line of the light barrier: its number on the chip, or its name (gpioinfo)")
    active_low: bool = Field(False, description="the line is low while the barrier is interrupted")
    debounce_ms: float = Field(
        5.0, ge=0, le=1000, description="the line must keep its level for so long, or it has only bounced"
    )


def check_takes_actions(name: str, backend: str, address: str) -> None:
    """Check that action commands reach a camera, and that its answers can be known for its own.

    Raises:
        ValueError: they do not, or cannot.
    """
    if backend != "aravis":
        raise ValueError(
            f'trigger.source "action" is a command to GigE Vision cameras, and {name} has backend "{backend}": use '
            'source = "external"'
        )
    try:
        _ipv4(address)
    except ValueError:
        raise ValueError(
            f'trigger.source "action" needs the IPv4 address of {name}, by which its answers are known, and '
            f'"{address}" is none: svev cameras list shows it'
        ) from None


class TriggerBoxTrigger(TriggerSettings):
    """A trigger box on a serial line, set and watched by svev: its cable leads to all cameras."""

    source: Literal["triggerbox"] = Field(description="a strawlab trigger box (protocol 14) on a serial line")
    rate_hz: float = Field(30.0, ge=3.82, le=1000, description="pulses per second; the nearest that the box can make")
    settle_s: float = Field(15.0, gt=0, le=120, description="wait at most this long for the first pulses")
    port: str = Field(
        "/dev/svev-trigger", min_length=1, max_length=200,
        description="device file of the serial line; where svev is installed, a rule for devices makes this link",
    )  # fmt: skip


def _external_unless_said(table: Any) -> Any:
    """A table that names no source means `external`."""
    return {"source": "external", **table} if isinstance(table, dict) else table


#: The `[trigger]` table: one of the sources, told by `source`.
Trigger = Annotated[
    Annotated[
        ExternalTrigger | SoftwareTrigger | ActionTrigger | IidcBroadcastTrigger | TriggerBoxTrigger | GpioTrigger,
        Field(discriminator="source"),
    ],
    BeforeValidator(_external_unless_said),
]
