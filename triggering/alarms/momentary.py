"""Alarms that follow from a single health record: clocks, trigger and rate contradict each other at present."""

from collections.abc import Iterator, Sequence
from typing import Final

from rig.events import PAIRING, Level
from rig.health import CameraPairing, PairingHealth, SourcePairing
from rig.phrase import Phrase, phrase
from triggering.alarms.alarm import RATE, SPREAD, Alarm

#: A rate that differs from the rig file's by more than this share contradicts it.
_RATE: Final = 0.02
#: A camera that is doubted for more frames than this needs to be restarted.
_DOUBTED: Final = 4


def momentary(health: PairingHealth, names: Sequence[str], rate_hz: float, *, one_edge: bool = True) -> Iterator[Alarm]:
    """The alarms at present, the most important first.

    Args:
        health: state of the pairing.
        names: of the cameras.
        rate_hz: rate of the pulses that the rig file names.
        one_edge: one edge exposes all cameras; if not, frames that lie apart are the source's nature, not a fault.
    """
    if (wrong := _rate(health, rate_hz)) is not None:
        yield _alarm(wrong, topic=RATE)
    clocks = (_clock(name, camera) for name, camera in zip(names, health.cameras, strict=True))
    yield from (_alarm(said) for said in clocks if said is not None)
    if health.source is not None:
        yield from map(_alarm, _contradictions(health.source))
    if one_edge and health.alarm:
        text = (
            "the frames of one pulse lie up to {spread_ms} ms apart: check the trigger cables and the cameras' delays"
        )
        said = phrase("pairing_spread", text, spread_ms=round(health.spread_max_us / 1000, 1))
        yield _alarm(said, topic=SPREAD, level=Level.ERROR)
    elif one_edge and health.split_us is not None:
        text = "two pulses came {apart_ms} ms apart, and no camera has both: check the trigger signal for bounces"
        yield _alarm(phrase("pairing_double", text, apart_ms=round(health.split_us / 1000, 1)))


def _rate(health: PairingHealth, rate_hz: float) -> Phrase | None:
    """The pulses come at another rate than the rig file names."""
    measured = health.rate_hz
    if measured is None or abs(measured / rate_hz - 1) <= _RATE:
        return None
    text = "pulses come at {measured} Hz, the rig file says rate_hz = {rate_hz:g}: correct [trigger] rate_hz"
    return phrase("pairing_rate", text, measured=round(measured, 1), rate_hz=rate_hz)


def _clock(name: str, camera: CameraPairing) -> Phrase | None:
    """The clock of a camera contradicts itself or the numbers and arrivals of its frames."""
    if camera.clock_set and camera.clock_from_zero:
        text = (
            "the clock of {camera} began again at zero while pulses came, some of its frames are not used: it ran "
            "over, or the camera restarted: check its power, and look for newer firmware"
        )
        return phrase("pairing_clock_zero", text, camera=name)
    if camera.clock_set:
        text = "the clock of {camera} was set while pulses came, some of its frames are not used: let PTP lock first"
        return phrase("pairing_clock", text, camera=name)
    if camera.doubted > _DOUBTED:
        text = (
            "numbers, times and arrivals of the frames of {camera} contradict each other, and its frames are not "
            "used: disarm, restart the camera, and arm again"
        )
        return phrase("pairing_doubt", text, camera=name)
    return None


def _contradictions(source: SourcePairing) -> Iterator[Phrase]:
    """The source and the cameras disagree on pulses."""
    if source.unseen_lately:
        text = "the source has fired {count} pulses that no camera saw: check the trigger cable from it to the cameras"
        yield phrase("pairing_unseen", text, count=source.unseen + source.untagged)
    if source.unfired_lately:
        text = "cameras saw {count} pulses that the source did not fire: check the trigger cable for other signals"
        yield phrase("pairing_unfired", text, count=source.unfired)


def _alarm(said: Phrase, *, topic: str = "", level: Level = Level.WARNING) -> Alarm:
    """An alarm of a topic; if none is given, of its own: its code, and its camera if there is one."""
    return Alarm(topic or f"{said.code} {said.values.get('camera', '')}", level, PAIRING, said)
