"""Finds the jumps in the candidates of a recording and names markers and skis in every image."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.candidates.model import PulseCandidates, Trace
from analysis.identification.body import FlightFrame
from analysis.identification.markers import BINDINGS, Markers, follow_markers
from analysis.identification.naming import NAMELESS, grouped, name_tracks
from analysis.identification.ski_traces import StraightTrace, straightened
from analysis.identification.skis import Skis, follow_skis
from analysis.identification.space_points import find_space_points, rays_of
from analysis.identification.tracks import Track, find_tracks
from analysis.identification.views import Views
from analysis.measurements.model import (
    POINTS,
    SIDES,
    ImageMeasurements,
    JumpMeasurements,
    PointMeasurement,
    PulseMeasurements,
    SkiMeasurement,
)
from analysis.scene.camera_system import CameraSystem

_SEARCH_HZ = 30.0  #: tracks are sought in so many pulses per second: displacements that stand out of the noise
_BEYOND_S = 0.6  #: that markers are followed before the first and after the last point of a track
_LEAST_NAMES = 2  #: a jumper has more than one point


def identify(
    candidates: Sequence[PulseCandidates],
    system: CameraSystem,
    rate_hz: float,
    exposures_s: Mapping[str, float] | None = None,
) -> list[JumpMeasurements]:
    """Find the jumps of a recording and name what is to be measured.

    Args:
        candidates: of the pulses, in order; pulses without any image may be left out.
        system: the oriented cameras.
        rate_hz: pulses per second.
        exposures_s: exposure time of each camera; all alike if left out.

    Returns:
        The jumps in order, each from the first to the last pulse in which the jumper was found. None: nobody jumped.
    """
    views = Views(system, exposures_s)
    stride = max(1, round(rate_hz / _SEARCH_HZ))
    sought = candidates[::stride]
    time_s = np.array([float(c.pulse) for c in sought]) / rate_hz
    points = find_space_points(views, [rays_of(views, c) for c in sought])
    jumps: list[JumpMeasurements] = []
    for tracks in grouped(find_tracks(points, time_s)):
        longest = max(tracks, key=len)
        frame = FlightFrame.along(longest.velocity())
        names = name_tracks(tracks, frame)
        if len(set(names) - {NAMELESS}) < _LEAST_NAMES:
            continue
        named = [(track, name) for track, name in zip(tracks, names, strict=True) if name != NAMELESS]
        jumps.append(_measured(views, candidates, rate_hz, frame, named, len(jumps) + 1))
    return jumps


def _measured(
    views: Views,
    candidates: Sequence[PulseCandidates],
    rate_hz: float,
    frame: FlightFrame,
    named: Sequence[tuple[Track, int]],
    number: int,
) -> JumpMeasurements:
    """The measurements of one jump from its named tracks."""
    begin = min(track.time_s[0] for track, _ in named) - _BEYOND_S
    end = max(track.time_s[-1] for track, _ in named) + _BEYOND_S
    window = [c for c in candidates if begin <= c.pulse / rate_hz <= end]
    time_s = np.array([c.pulse / rate_hz for c in window])
    rays = [rays_of(views, c) for c in window]
    delivered = np.array([[name in c.images for name in views.names] for c in window])
    start = {
        (int(np.abs(time_s - time).argmin()), name): (track.xyz[i], track.covariance[i])
        for track, name in named
        for i, time in enumerate(track.time_s)
    }
    markers = follow_markers(views, time_s, rays, delivered, find_space_points(views, rays), frame, start)
    traces = [[straightened(c.images[name].traces) if name in c.images else [] for name in views.names] for c in window]
    skis = follow_skis(views, time_s, traces, delivered, frame, markers.places(BINDINGS))
    pulses = [_pulse(views, c, markers, skis, traces[t], t) for t, c in enumerate(window)]
    found = [t for t, pulse in enumerate(pulses) if any(i.points or i.skis for i in pulse.images.values())]
    return JumpMeasurements(number, tuple(pulses[found[0] : found[-1] + 1]))


def _pulse(
    views: Views,
    candidates: PulseCandidates,
    markers: Markers,
    skis: Skis,
    lines: Sequence[Sequence[StraightTrace]],
    t: int,
) -> PulseMeasurements:
    images = {}
    for k, name in enumerate(views.names):
        if name not in candidates.images:
            continue
        spots = candidates.images[name].spots
        points = {
            label: PointMeasurement(spots.xy[s], spots.covariance[s])
            for i, label in enumerate(POINTS)
            if (s := int(markers.assigned.rays[t, i, k])) >= 0
        }
        traces = candidates.images[name].traces
        measured = {
            side: _ski([traces[part] for part in lines[k][line].parts])
            for i, side in enumerate(SIDES)
            if (line := int(skis.traces[t, i, k])) >= 0
        }
        images[name] = ImageMeasurements(points, measured)
    return PulseMeasurements(candidates.pulse, candidates.time, images)


def _ski(parts: Sequence[Trace]) -> SkiMeasurement:
    xy, sigma = np.concatenate([part.xy for part in parts]), np.concatenate([part.sigma for part in parts])
    return SkiMeasurement(xy, sigma, common=max(part.common for part in parts))
