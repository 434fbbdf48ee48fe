"""The truth beside a log of the simulated hill: what the cameras really saw, pulse by pulse of the recording."""

import json
from pathlib import Path

from recorder.log_reader import triplets
from rig.settings import RigSettings
from simrig.images import stamp
from simrig.world.scenario import load_scenario
from simrig.world.truth import truth


def hill_pulses(log: Path, rig: RigSettings) -> dict[int, set[int]]:
    """For each pulse of the recording, the hill pulses that the stamps in its frames name; more than one is a mix."""
    columns = rig.columns()
    found: dict[int, set[int]] = {}
    for tag, image in triplets(log):
        stamps = [
            stamp.read(image[:, first:end])
            for (first, end), camera in zip(columns, tag.cameras, strict=True)
            if camera.status == "ok"
        ]
        found[tag.pulse] = {seen.pulse for seen in stamps if seen is not None}
    return found


def write_truth(log: Path, rig: RigSettings) -> Path:
    """Write `LOG.truth.json`: the scenario's truth, keyed by the pulse numbers of the log.

    Returns:
        The file.
    """
    if rig.simulation is None:
        raise ValueError("only the simulated hill knows the truth")
    scenario = load_scenario(rig.simulation.scenario)
    of_recording = {pulse: min(hill) for pulse, hill in hill_pulses(log, rig).items() if hill}
    region = rig.cameras[0].region
    content = truth(scenario, of_recording.values(), rig.trigger.rate_hz, (region.width, region.height))
    content["hill_pulse_of_recording"] = {str(pulse): hill for pulse, hill in of_recording.items()}
    path = log.with_suffix(".truth.json")
    path.write_text(json.dumps(content), encoding="utf-8")
    return path
