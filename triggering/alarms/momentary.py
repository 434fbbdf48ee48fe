"""Alarms that follow from a single health record: clocks, trigger and rate contradict each other at present."""

from collections.abc import Iterator, Sequence
from typing import Final

from rig.events import PAIRING, Level
from rig.health import PairingHealth
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
    measured = health.rate_hz
    if measured is not None and abs(measured / rate_hz - 1) > _RATE:
        text = "pulses come at {measured} Hz, the rig file says rate_hz = {rate_hz:g}: correct [trigger] rate_hz"
        yield _alarm(phrase("pairing_rate", text, measured=round(measured, 1), rate_hz=rate_hz), topic=RATE)
    for name, camera in zip(names, health.cameras, strict=True):
        if camera.clock_set and camera.clock_from_zero:
            text = (
                "the clock of {camera} began again at zero while pulses came, some of its frames are not used: it ran "
                "over, or the camera restarted: check its power, and look for newer firmware"
            )
            yield _alarm(phrase("pairing_clock_zero", text, camera=name))
        elif camera.clock_set:
            text = (
                "the clock of {camera} was set while pulses came, some of its frames are not used: let PTP lock first"
            )
            yield _alarm(phrase("pairing_clock", text, camera=name))
        elif camera.doubted > _DOUBTED:
            text = (
                "numbers, times and arrivals of the frames of {camera} contradict each other, and its frames are not "
                "used: disarm, restart the camera, and arm again"
            )
            yield _alarm(phrase("pairing_doubt", text, camera=name))
    if health.source is not None and health.source.unseen_lately:
        count = health.source.unseen + health.source.untagged
        text = "the source has fired {count} pulses that no camera saw: check the trigger cable from it to the cameras"
        yield _alarm(phrase("pairing_unseen", text, count=count))
    if health.source is not None and health.source.unfired_lately:
        text = "cameras saw {count} pulses that the source did not fire: check the trigger cable for other signals"
        yield _alarm(phrase("pairing_unfired", text, count=health.source.unfired))
    if not one_edge:
        return
    if health.alarm:
        text = (
            "the frames of one pulse lie up to {spread_ms} ms apart: check the trigger cables and the cameras' delays"
        )
        yield _alarm(
            phrase("pairing_spread", text, spread_ms=round(health.spread_max_us / 1000, 1)),
            topic=SPREAD,
            level=Level.ERROR,
        )
    elif health.split_us is not None:
        text = "two pulses came {apart_ms} ms apart, and no camera has both: check the trigger signal for bounces"
        yield _alarm(phrase("pairing_double", text, apart_ms=round(health.split_us / 1000, 1)))


def _alarm(said: Phrase, *, topic: str = "", level: Level = Level.WARNING) -> Alarm:
    """An alarm of a topic; if none is given, of its own: its code, and its camera if there is one."""
    return Alarm(topic or f"{said.code} {said.values.get('camera', '')}", level, PAIRING, said)
