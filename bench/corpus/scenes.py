"""Renders a scene of the corpus into a log, with its survey and truth."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench.analysis.hill_logs import HillLog, View, write_hill_log
from bench.corpus.drawn_hill import DrawnHill
from bench.corpus.draws import Scene
from bench.corpus.path_traced.hill import PathTracedHill


def render(scene: Scene, path: Path) -> HillLog:
    """Write the log of a scene.

    Args:
        scene: the scene.
        path: the log, without its ending.

    Raises:
        BadInputError: Blender is asked for, and is missing or fails.
    """
    if scene.renderer == "path-traced":
        hill = PathTracedHill(scene.scenario, scene.pulses, scene.size, scene.rate_hz)
        log = _written(scene, path, hill.views())
        return replace(log, truth=hill.truth(log.truth))
    if scene.renderer == "drawn":
        drawn = DrawnHill(scene.scenario, scene.pulses, scene.scenario.seed, scene.size, scene.rate_hz)
        return _written(scene, path, drawn.views())
    return _written(scene, path, None)


def _written(scene: Scene, path: Path, views: Sequence[View] | None) -> HillLog:
    """The log with what the cameras see; None: what the simulated hill shows."""
    return write_hill_log(path, scene.scenario, scene.pulses, scene.size, scene.rate_hz, views)
