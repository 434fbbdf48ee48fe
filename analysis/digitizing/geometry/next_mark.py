"""Where an operator should click next: the marks of a jump, as the search for the best one takes them."""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.digitizing.geometry.pulse_marks import PulseMarks
from analysis.digitizing.geometry.space import intersected
from analysis.digitizing.geometry.suggesting import PathMarks, suggest
from analysis.measurements.model import POINTS
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import Suggestion


def next_mark(
    system: CameraSystem, marks: Sequence[PulseMarks], has: Callable[[int, str], bool], rate_hz: float
) -> Suggestion | None:
    """The click that lowers the sigmas of P1 to P4 most.

    Args:
        system: the oriented cameras.
        marks: of the pulses of a jump, in order.
        has: whether a camera delivered a frame of a pulse.
        rate_hz: pulses per second.

    Returns:
        None if no click helps, or no point is known in space yet.
    """
    rays = [of.rays() for of in marks]
    keys = [(k, thing) for k, of in enumerate(rays) for thing in of if thing in POINTS]
    found = intersected(system, {f"{k} {thing}": rays[k][thing] for k, thing in keys}).adjusted
    paths = {}
    for thing in POINTS:
        solved = {k: found.state[i] for i, (k, of) in enumerate(keys) if of == thing and found.ok[i]}
        if not solved:
            continue
        known = np.array(sorted(solved))
        xyz = np.array([solved[k] for k in known])
        places = np.stack([np.interp(np.arange(len(marks)), known, xyz[:, i]) for i in range(3)], axis=1)
        measured = [[name in of.get(thing, {}) for name in system.names] for of in rays]
        closed = [[not has(of.pulse, name) or of.says_nothing(name, thing) for name in system.names] for of in marks]
        paths[thing] = PathMarks(places, np.array(measured), np.array(closed))
    best = suggest(system, system.names, [of.pulse for of in marks], paths, rate_hz)
    if best is None:
        return None
    return Suggestion(pulse=best.pulse, camera=best.camera, thing=best.thing, why=best.why)
