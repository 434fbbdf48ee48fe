"""Puts what a person measured beside what was measured automatically, or in its place."""

from collections.abc import Mapping

from analysis.measurements.model import (
    ImageMeasurements,
    JumpMeasurements,
    MeasuredCamera,
    Measurements,
    PulseMeasurements,
)
from rig.errors import BadInputError


def merged(automatic: Measurements, by_hand: Measurements) -> Measurements:
    """All measurements of a recording; where both have a point or ski of an image, the one by hand counts.

    Times, rate and exposures are those of the automatic ones. Pulses that only a person measured belong to the jump of
    the number that he gives; a new number is a new jump.

    Raises:
        BadInputError: they belong to different recordings, or to images of different sizes, or put a pulse into
            another jump.
    """
    if by_hand.recording and automatic.recording and by_hand.recording != automatic.recording:
        raise BadInputError(
            f"measurements by hand are of recording {by_hand.recording}, not of {automatic.recording}; name their log"
        )
    jumps = {jump.number: jump for jump in automatic.jumps}
    own = {pulse.pulse: jump.number for jump in automatic.jumps for pulse in jump.pulses}
    for jump in by_hand.jumps:
        for pulse in jump.pulses:
            if own.get(pulse.pulse, jump.number) != jump.number:
                raise BadInputError(
                    f"pulse {pulse.pulse} is of jump {own[pulse.pulse]}, but measured by hand as of jump "
                    f'{jump.number}; correct "number"'
                )
        jumps[jump.number] = _jump(jumps[jump.number], jump) if jump.number in jumps else jump
    return Measurements(
        automatic.recording or by_hand.recording,
        automatic.rate_hz,
        _cameras(automatic.cameras, by_hand.cameras),
        tuple(jumps[number] for number in sorted(jumps)),
    )


def _cameras(
    automatic: Mapping[str, MeasuredCamera], by_hand: Mapping[str, MeasuredCamera]
) -> dict[str, MeasuredCamera]:
    for name in automatic.keys() & by_hand.keys():
        if automatic[name].size != by_hand[name].size:
            sizes = [f"{camera[name].size[0]} x {camera[name].size[1]}" for camera in (automatic, by_hand)]
            raise BadInputError(
                f"camera {name}: images have {sizes[0]} px, but were measured by hand with {sizes[1]} px; "
                "measure in the images of this recording"
            )
    return {**by_hand, **automatic}


def _jump(automatic: JumpMeasurements, by_hand: JumpMeasurements) -> JumpMeasurements:
    pulses = {pulse.pulse: pulse for pulse in automatic.pulses}
    for pulse in by_hand.pulses:
        pulses[pulse.pulse] = _pulse(pulses[pulse.pulse], pulse) if pulse.pulse in pulses else pulse
    return JumpMeasurements(automatic.number, tuple(pulses[number] for number in sorted(pulses)))


def _pulse(automatic: PulseMeasurements, by_hand: PulseMeasurements) -> PulseMeasurements:
    images = dict(automatic.images)
    for camera, image in by_hand.images.items():
        there = images.get(camera, ImageMeasurements({}, {}))
        images[camera] = ImageMeasurements({**there.points, **image.points}, {**there.skis, **image.skis})
    return PulseMeasurements(automatic.pulse, automatic.time, images)
