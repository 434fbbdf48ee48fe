"""Reads from the images of a log which hill pulses the simulated cameras drew: nothing but tests may."""

from pathlib import Path

from recorder.reading.triplets import triplets
from rig.pulse import HillPulse, PulseNumber
from rig.settings.model import RigSettings
from simrig.images import stamp


def hill_pulses(log: Path, rig: RigSettings) -> dict[PulseNumber, set[HillPulse]]:
    """For each pulse of a recording, the hill's pulses that its frames were stamped with; more than one is a mix-up."""
    columns = rig.columns()
    found: dict[PulseNumber, set[HillPulse]] = {}
    for tag, image in triplets(log):
        stamps = [
            stamp.read(image[:, first:end])
            for (first, end), camera in zip(columns, tag.cameras, strict=True)
            if camera.status == "ok"
        ]
        found[tag.pulse] = {seen.pulse for seen in stamps if seen is not None}
    return found
