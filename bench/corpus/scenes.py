"""Renders a scene of the corpus into a log, with its survey and truth."""

from pathlib import Path

from bench.analysis.hill_logs import HillLog, View, write_hill_log
from bench.corpus.drawn_hill import DrawnHill
from bench.corpus.draws import Scene


def render(scene: Scene, path: Path) -> HillLog:
    """Write the log of a scene.

    Args:
        scene: the scene.
        path: the log, without its ending.
    """
    return write_hill_log(path, scene.scenario, scene.pulses, scene.size, scene.rate_hz, _views(scene))


def _views(scene: Scene) -> list[View] | None:
    """What the cameras see; None: what the simulated hill shows."""
    if scene.renderer == "hill":
        return None
    hill = DrawnHill(scene.scenario, scene.pulses, scene.scenario.seed, scene.size, scene.rate_hz)
    return list(hill.views())
