"""How fast a GigE Vision camera sends: slowly enough for the others at its port, fast enough for the pulses.

Cameras behind one switch expose and begin to send at the same instant; what the port to the computer cannot carry at
once waits in the switch, and is dropped where the switch has no memory for it. So each camera leaves the time between
its packets to the others. Makers have three ways for that: a delay after each packet, in ticks of the camera's clock
(`GevSCPD`), or bytes per second (`StreamBytesPerSecond`, `DeviceLinkThroughputLimit`). Other programs leave any of
them behind.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from capture.aravis.features import Features
from rig.clocks import NS_PER_S, NS_PER_US
from rig.errors import CameraError
from rig.host.interfaces import interface_to
from rig.settings.model import PacketDelay

_DELAY: Final = "GevSCPD"
#: Aravis adds a GevSCPD of 1000 ticks at most to descriptions without one, and this for the register itself.
_DELAY_REGISTER: Final = "ArvGevSCPD"
_LIMITS: Final = ("StreamBytesPerSecond", "DeviceLinkThroughputLimit")
_LIMIT_MODE: Final = "DeviceLinkThroughputLimitMode"
_SWITCHED: Final = ("DeviceLinkThroughputLimit",)  # by it
#: Bytes of a packet that are no picture: headers of IP, UDP and GVSP; and those around it on the wire: Ethernet header,
#: check sum, preamble, gap.
_HEADER_BYTES, _WIRE_BYTES = 36, 38
_LEADER_AND_TRAILER: Final = 2
#: So much of the time between two pulses may be spent on a frame: the rest is for packets that are sent again.
_SHARE: Final = 0.8
#: Cameras round the delay to their own steps; a share of it.
_DELAY_ROUNDING: Final = 0.05


@dataclass(frozen=True, slots=True)
class Wire:
    """The network port at which a camera's packets come in.

    Attributes:
        cameras: how many cameras of the rig send to it.
        mbit_s: its speed; None: it has none (loopback, virtual ports), so that nothing has to wait there.
    """

    cameras: int = 1
    mbit_s: int | None = None

    @classmethod
    def to(cls, address: str, addresses: Sequence[str]) -> "Wire":
        """The port that leads to a camera.

        Args:
            address: of the camera.
            addresses: of all cameras of the rig.
        """
        ports = []
        for each in (address, *addresses):
            with suppress(OSError):  # nothing leads there: opening the camera says so
                ports.append(interface_to(each))
        port = ports[0] if ports else None
        return cls() if port is None else cls(max(1, ports[1:].count(port)), port.speed_mbps)

    def packet_ns(self, packet_size: int) -> float:
        """How long a packet of so many bytes occupies the port, ns; 0 if that is not known."""
        return 0.0 if self.mbit_s is None else (packet_size + _WIRE_BYTES) * 8_000 / self.mbit_s


@dataclass(frozen=True, slots=True)
class Frames:
    """What a camera sends.

    Attributes:
        frame_bytes: of a frame.
        packet_size: of a packet, its IP header included, bytes.
        period_ns: time between two frames.
        tick_hz: ticks of its clock per second, in which it counts delays.
    """

    frame_bytes: int
    packet_size: int
    period_ns: int
    tick_hz: int = NS_PER_S

    @property
    def packets(self) -> int:
        """How many make up a frame."""
        return math.ceil(self.frame_bytes / (self.packet_size - _HEADER_BYTES)) + _LEADER_AND_TRAILER


@dataclass(frozen=True, slots=True)
class Pace:
    """How a camera sends.

    Attributes:
        frame_ns: time from the first to the last packet of a frame, at least.
        by: the feature that makes it so; empty: the port.
        notices: settings that the camera refuses and what each costs, a sentence each.
    """

    frame_ns: float
    by: str
    notices: tuple[str, ...] = ()


def set_pace(features: Features, name: str, wanted: PacketDelay, frames: Frames, wire: Wire) -> Pace:
    """Have a camera leave time between its packets.

    Args:
        features: of the camera, whose packet size is set.
        name: of the camera.
        wanted: `network.packet_delay` of the rig file.
        frames: what it sends.
        wire: the port at which that comes in.

    Raises:
        CameraError: a frame takes longer than the time between two pulses.
    """
    wire_ns = wire.packet_ns(frames.packet_size)
    notices = []
    if wanted != "keep":
        delay_ns = _spread(frames, wire) if wanted == "auto" else wanted * NS_PER_US
        ticks = round(delay_ns * frames.tick_hz / NS_PER_S)
        notices = _write(features, ticks, frames.packet_size * NS_PER_S / (wire_ns + delay_ns or math.inf))
    each_ns, by = _slowest(features, frames, wire_ns)
    pace = Pace(each_ns * frames.packets, by, tuple(notices))
    if pace.frame_ns > frames.period_ns:
        raise CameraError(
            f"camera {name} needs {pace.frame_ns / 1e6:.1f} ms to send a frame ({by or 'speed of the port'}), "
            f"and pulses come every {frames.period_ns / 1e6:.1f} ms: {_remedy(wanted, by)}"
        )
    return pace


def _remedy(wanted: PacketDelay, by: str) -> str:
    if by and wanted != "auto":
        return 'set network.packet_delay = "auto" in the rig file'
    return "choose a smaller region or fewer bits per pixel, or lower trigger.rate_hz"


def _spread(frames: Frames, wire: Wire) -> float:
    """Time between two packets that is left to the other cameras at the port, ns."""
    wire_ns = wire.packet_ns(frames.packet_size)
    longest = _SHARE * frames.period_ns / frames.packets - wire_ns
    return max(0.0, min((wire.cameras - 1) * wire_ns, longest))


def _write(features: Features, ticks: int, bytes_s: float) -> list[str]:
    """Set the delay by the first way that the camera has, and take away other limits.

    Args:
        features: of the camera.
        ticks: time between two packets, by its clock.
        bytes_s: the same as a rate; 0 if it is not known.
    """
    delayed = _delay(features, _DELAY, ticks)
    limits = [limit for limit in _LIMITS if features.has(limit)]
    limited = not delayed and ticks > 0 and bytes_s > 0 and bool(limits)
    features.switch(_LIMIT_MODE, on=limited)
    notices = []
    for limit in limits:
        if limit in _SWITCHED and features.chosen(_LIMIT_MODE) == "Off":
            continue
        if features.set_number(limit, bytes_s if limited else math.inf) is None:
            notices.append(f"{limit} stays {features.number(limit) or 0:g} bytes per second")
    if not (delayed or limited or _delay(features, _DELAY_REGISTER, ticks)):
        notices.append("its packets follow each other at once (it takes no GevSCPD): a switch may drop some")
    return notices


def _delay(features: Features, name: str, ticks: int) -> bool:
    """Set the delay between packets; whether it is nearly so now. If not, there is none."""
    got = features.set_number(name, ticks)
    least, _, step = features.bounds(name) or (0, 0, 1)
    if got is not None and abs(got - max(ticks, least)) <= max(_DELAY_ROUNDING * ticks, step):
        return True
    features.set_number(name, 0)
    return False


def _slowest(features: Features, frames: Frames, wire_ns: float) -> tuple[float, str]:
    """Time from one packet to the next, ns, and the feature that makes it so long; empty: the port alone."""
    delay_ns = (features.number(_DELAY) or 0.0) * NS_PER_S / frames.tick_hz
    ways = {"": wire_ns, _DELAY: wire_ns + delay_ns if delay_ns else 0.0}
    for limit in _LIMITS:
        off = limit in _SWITCHED and features.chosen(_LIMIT_MODE) == "Off"
        if (bytes_s := features.number(limit)) and not off:
            ways[limit] = frames.packet_size * NS_PER_S / bytes_s
    by = max(ways, key=lambda way: ways[way])
    return ways[by], by
