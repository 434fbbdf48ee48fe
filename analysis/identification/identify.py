"""Finds the jumps in the candidates of a recording and names markers and skis in every image."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.candidates.model import PulseCandidates, SecondLook, Trace
from analysis.candidates.skis.ski_widths import SkiWidth, clear_widths, told_apart
from analysis.identification.markers.markers import BINDINGS, Markers, follow_further, follow_markers
from analysis.identification.markers.refinement import refined
from analysis.identification.markers.synchrony import lateness
from analysis.identification.over_time.assignment import well_known
from analysis.identification.over_time.flights import Flight, find_flights, find_tracks
from analysis.identification.over_time.window import Window
from analysis.identification.skis.ski_traces import StraightTrace, straightened
from analysis.identification.skis.skis import LONGEST_M, Places, follow_skis
from analysis.identification.space.body import REACH_M
from analysis.identification.space.space_points import Appearance
from analysis.identification.space.views import Views
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
from rig.arrays import Flags, Floats, Integers

_SEARCH_HZ = 30.0  #: tracks are sought in so many pulses per second: displacements that stand out of the noise
_BEYOND_S = 0.6  #: that markers are followed before the first and after the last point of a track
_LEAST_NAMES = 2  #: a jumper has more than one point
_LEAST_PULSES = 3  #: and shows them in more than a glimpse
_SIGMAS = 3.0  #: of a binding's place, within which skis are sought
#: Skis turn with up to 30 rad/s^2, by a third of a radian in this time: how they were before says little of them now.
_SKIS_S = 0.15


def identify(
    candidates: Sequence[PulseCandidates],
    system: CameraSystem,
    rate_hz: float,
    exposures_s: Mapping[str, float] | None = None,
    look: SecondLook | None = None,
) -> list[JumpMeasurements]:
    """Find the jumps of a recording and name what is to be measured.

    Args:
        candidates: of the pulses, in order; pulses without any image may be left out.
        system: the oriented cameras.
        rate_hz: pulses per second.
        exposures_s: exposure time of each camera; all alike if left out.
        look: looks again where a marker is expected (`Finder`); it finds more of them, and centres of covered ones.

    Returns:
        The jumps in order, each from the first to the last pulse in which the jumper was found. None: nobody jumped.
    """
    jumps: list[JumpMeasurements] = []
    for sighting in find_sightings(candidates, system, rate_hz, exposures_s):
        if pulses := sighting.measured(look):
            jumps.append(JumpMeasurements(len(jumps) + 1, pulses))
    return jumps


def find_sightings(
    candidates: Sequence[PulseCandidates],
    system: CameraSystem,
    rate_hz: float,
    exposures_s: Mapping[str, float] | None = None,
) -> "list[Sighting]":
    """What moves like a jumper, with its markers as far as the first look tells them; arguments as of `identify`."""
    views = Views(system, exposures_s)
    sought = candidates[:: stride(rate_hz)]
    search = Window(views, sought, rate_hz)
    flights = find_flights(find_tracks(search.points, search.time_s))
    return [sighted(views, candidates, rate_hz, flight, appearance_of(views, sought, flight)) for flight in flights]


def stride(rate_hz: float) -> int:
    """Of the pulses every so many are enough to find tracks."""
    return max(1, round(rate_hz / _SEARCH_HZ))


def sighted(
    views: Views,
    candidates: Sequence[PulseCandidates],
    rate_hz: float,
    flight: Flight,
    appearance: Appearance,
    *,
    on_time: bool = False,
) -> "Sighting":
    """What moves along a path, with its markers as far as the first look tells them.

    Args:
        views: the cameras.
        candidates: of the pulses, in order.
        rate_hz: pulses per second.
        flight: the path.
        appearance: of the markers.
        on_time: take all cameras to obey the trigger, without looking whether one shows the jumper late; faster.
    """
    begin, end = flight.begin_s - _BEYOND_S, flight.end_s + _BEYOND_S
    near = [c for c in candidates if begin <= c.pulse / rate_hz <= end]
    window = Window(views, near, rate_hz, flight, appearance)
    markers = follow_markers(views, window, flight)
    late_s = np.zeros(len(views)) if on_time else lateness(views, window, markers, flight)
    if late_s.any():
        window = Window(views, near, rate_hz, flight, appearance, late_s)
        markers = follow_markers(views, window, flight)
    return Sighting(views, window, flight, appearance, markers)


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Something that moves like a jumper.

    Attributes:
        views: the cameras.
        window: the pulses in which he may be in sight.
        flight: his path.
        appearance: of his markers.
        markers: as the first look names them.
    """

    views: Views
    window: Window
    flight: Flight
    appearance: Appearance
    markers: Markers

    def pulses(self) -> range:
        """From the first to the last pulse with a named marker; empty if he shows too few of them to be a jumper."""
        named: Flags = np.asarray(np.any(self.markers.assigned.rays >= 0, axis=2))
        if not _is_jumper(named):
            return range(0)
        there = np.flatnonzero(named.any(axis=1))
        first, last = (self.window.candidates[int(t)].pulse for t in there[[0, -1]])
        return range(first, last + 1)

    def named(self) -> int:
        """How many of his markers have a place in any pulse."""
        return int(np.count_nonzero(np.isfinite(self.markers.assigned.xyz).all(axis=2).any(axis=0)))

    def measured(self, look: SecondLook | None, *, briefly: bool = False) -> tuple[PulseMeasurements, ...]:
        """What was measured of him, from his first to his last appearance; empty if he is no jumper.

        Args:
            look: as of `identify`; what it finds is added to the window.
            briefly: seek skis only in the last moments (`_SKIS_S`) until the last pulse with a named marker; faster.
        """
        views, window, flight, markers = self.views, self.window, self.flight, self.markers
        if look is not None:
            markers = follow_further(views, window, flight, markers, look)
            markers = refined(views, window, flight, markers, self.appearance, look)
        if not _is_jumper(np.asarray(np.any(markers.assigned.rays >= 0, axis=2))):
            return ()
        steps = np.ones(len(window), bool)
        if briefly:
            numbers, named = np.array([c.pulse for c in window.candidates]), self.pulses()
            steps = (numbers >= named[0]) & (numbers <= named[-1])
            steps &= window.time_s > window.time_s[steps][-1] - _SKIS_S
        look_for_traces(views, window, markers.places(BINDINGS), steps)
        _tell_skis_apart(views, window, flight)
        traces = straight_traces(views, window)
        skis = follow_skis(views, window, traces, flight, markers.places(BINDINGS))
        pulses = [
            named_pulse(views, c, markers.assigned.rays[t], skis.traces[t], traces[t])
            for t, c in enumerate(window.candidates)
        ]
        found = [t for t, pulse in enumerate(pulses) if any(i.points or i.skis for i in pulse.images.values())]
        return tuple(pulses[found[0] : found[-1] + 1])


def appearance_of(views: Views, candidates: Sequence[PulseCandidates], flight: Flight) -> Appearance:
    """What the spots of a flight look like: most points of its tracks are markers."""
    seen = [
        (spots.contrast[i], spots.radius[i] / views.scale[k])
        for track in flight.tracks
        for step, rays in zip(track.step.tolist(), track.rays.tolist(), strict=True)
        for k, i in enumerate(rays)
        if i >= 0 and (spots := candidates[step].images[views.names[k]].spots)
    ]
    contrasts, radii = np.array(seen).T
    return Appearance.of(contrasts, radii)


def _is_jumper(named: Flags) -> bool:
    """Whether enough markers (t, 4) are named in enough pulses."""
    return bool(np.count_nonzero(named.sum(axis=1) >= _LEAST_NAMES) >= _LEAST_PULSES)


def look_for_traces(views: Views, window: Window, bindings: Places, steps: Flags) -> None:
    """Find the traces of what may be skis in some pulses (t,): nothing else is as near to the bindings.

    Where a binding could be anywhere, none is sought: no trace would be named as its ski.
    """
    wanted = steps[:, None] & well_known(bindings.covariance)
    spread = np.sqrt(np.linalg.eigvalsh(bindings.covariance)[..., -1])
    reach_m = np.minimum(LONGEST_M + _SIGMAS * spread, REACH_M)
    for k in range(len(views)):
        sight = views.see(k, bindings.xyz.reshape(-1, 3))
        scale = np.linalg.norm(np.nan_to_num(sight.by_point), ord=2, axis=(1, 2))
        places = sight.xy.reshape(-1, 2, 2) - window.shift[:, k, None]
        places[~wanted] = np.nan
        window.look_for_traces(k, places, reach_m * scale.reshape(-1, 2))


def _tell_skis_apart(views: Views, window: Window, flight: Flight) -> None:
    """Learn how wide a ski of this jump is for each camera, and correct the traces of skis that hide each other."""
    scales: list[Floats] = []
    near: list[list[list[int]]] = []
    widths: list[list[float]] = []
    for k in range(len(views)):
        sight = views.see(k, flight.place(window.time_s))
        scales.append(np.asarray(np.linalg.norm(np.nan_to_num(sight.by_point), ord=2, axis=(1, 2))))
        near.append([])
        widths.append([])
        for t, middle in enumerate(sight.xy - window.shift[:, k]):
            traces, scale = window.traces(t, k), float(scales[k][t])
            away = [float(np.linalg.norm(trace.ends.mean(axis=0) - middle)) for trace in traces]
            near[k].append([i for i, distance in enumerate(away) if distance < REACH_M * scale])
            widths[k] += [px / scale for px in clear_widths([traces[i] for i in near[k][t]])]
    everywhere = SkiWidth.of([width for of_camera in widths for width in of_camera])
    for k in range(len(views)):
        known = SkiWidth.of(widths[k]) or everywhere
        if known is None:
            continue
        for t, own in enumerate(near[k]):
            if own:
                traces = window.traces(t, k)
                told = told_apart([traces[i] for i in own], known.m * float(scales[k][t]), known.spread)
                window.put_traces(t, k, told + tuple(trace for i, trace in enumerate(traces) if i not in own))


def straight_traces(views: Views, window: Window) -> list[list[list[StraightTrace]]]:
    """The straight traces of each pulse of a window by camera."""
    return [
        [
            straightened(c.images[name].traces, window.shift[t, k]) if name in c.images else []
            for k, name in enumerate(views.names)
        ]
        for t, c in enumerate(window.candidates)
    ]


def named_pulse(
    views: Views,
    candidates: PulseCandidates,
    rays: Integers,
    skis: Integers,
    lines: Sequence[Sequence[StraightTrace]],
) -> PulseMeasurements:
    """What was measured in the images of a pulse, by its candidates with their names.

    Args:
        views: the cameras.
        candidates: of the pulse.
        rays: (4, m) spot of each marker in each image; -1: none.
        skis: (2, m) straight trace of each ski in each image; -1: none.
        lines: straight traces by camera.
    """
    images = {}
    for k, name in enumerate(views.names):
        if name not in candidates.images:
            continue
        spots = candidates.images[name].spots
        points = {
            label: PointMeasurement(spots.xy[s], spots.covariance[s])
            for i, label in enumerate(POINTS)
            if (s := int(rays[i, k])) >= 0
        }
        traces = candidates.images[name].traces
        measured = {
            side: _ski([traces[part] for part in lines[k][line].parts])
            for i, side in enumerate(SIDES)
            if (line := int(skis[i, k])) >= 0
        }
        images[name] = ImageMeasurements(points, measured)
    return PulseMeasurements(candidates.pulse, candidates.time, images)


def _ski(parts: Sequence[Trace]) -> SkiMeasurement:
    xy, sigma = np.concatenate([part.xy for part in parts]), np.concatenate([part.sigma for part in parts])
    common, lasting = max(part.common for part in parts), max(part.lasting for part in parts)
    return SkiMeasurement(xy, sigma, common=common, lasting=lasting)
