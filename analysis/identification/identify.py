"""Finds the jumps in the candidates of a recording and names markers and skis in every image."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.candidates.model import PulseCandidates, SecondLook
from analysis.identification.markers.markers import (
    Markers,
    follow_further,
    follow_markers,
    settled_again,
    without_bindings,
)
from analysis.identification.markers.refinement import only_worn, refined
from analysis.identification.markers.synchrony import lateness
from analysis.identification.over_time.flights import Flight, find_flights, find_tracks
from analysis.identification.over_time.window import Window
from analysis.identification.ski_bars import MeasuredSkis, measure_skis
from analysis.identification.space.body import BINDINGS, HIP
from analysis.identification.space.space_points import Appearance
from analysis.identification.space.views import Views
from analysis.identification.unmarked_skis import beside_skis, off_skis, shown_by_two
from analysis.measurements.model import (
    POINTS,
    ImageMeasurements,
    JumpMeasurements,
    PointMeasurement,
    PulseMeasurements,
)
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Flags, Integers

_SEARCH_HZ = 30.0  #: tracks are sought in so many pulses per second: displacements that stand out of the noise
_BEYOND_S = 0.6  #: that markers are followed before the first and after the last point of a track
_LEAST_NAMES = 2  #: a jumper has more than one point
_LEAST_PULSES = 3  #: and shows them in more than a glimpse
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
            briefly: with nothing but what the first look found, and with skis only in the last moments (`_SKIS_S`)
                until the last pulse with a named marker; faster.
        """
        views, window, flight, markers = self.views, self.window, self.flight, self.markers
        if look is not None and not briefly:
            markers = follow_further(views, window, flight, markers, look)
            markers = refined(views, window, flight, markers, self.appearance, look)
        elif look is not None:
            markers = only_worn(views, window, flight, markers, self.appearance, look)
        if not _is_jumper(np.asarray(np.any(markers.assigned.rays >= 0, axis=2))):
            return ()
        steps = np.ones(len(window), bool)
        if briefly:
            numbers, named = np.array([c.pulse for c in window.candidates]), self.pulses()
            steps = (numbers >= named[0]) & (numbers <= named[-1])
            steps &= window.time_s > window.time_s[steps][-1] - _SKIS_S
        places, hips = markers.places(BINDINGS), markers.places(HIP)
        skis: Sequence[MeasuredSkis] = [{}] * len(window)
        if look is not None:
            skis = measure_skis(views, window, flight, places, hips, look, steps)
            seen = np.any(markers.assigned.rays >= 0, axis=(1, 2))
            if not briefly and shown_by_two(skis) < np.count_nonzero(seen):  # half of two skis each
                markers, skis = self._by_skis(markers, skis, look, steps)
        pulses = [named_pulse(views, c, markers.assigned.rays[t], skis[t]) for t, c in enumerate(window.candidates)]
        found = [t for t, pulse in enumerate(pulses) if any(i.points or i.skis for i in pulse.images.values())]
        return tuple(pulses[found[0] : found[-1] + 1])

    def _by_skis(
        self, markers: Markers, skis: Sequence[MeasuredSkis], look: SecondLook, steps: Flags
    ) -> tuple[Markers, Sequence[MeasuredSkis]]:
        """Markers and skis where bindings led to few skis: from a search without bindings, if it finds more skis."""
        views, window, flight = self.views, self.window, self.flight
        beside = beside_skis(views, window, flight, markers, look)
        if beside is None:
            return markers, skis
        others = measure_skis(views, window, flight, beside.places(BINDINGS), beside.places(HIP), look, steps)
        if shown_by_two(others) <= shown_by_two(skis):
            return markers, skis
        markers = follow_further(views, window, flight, settled_again(views, window, flight, beside), look)
        markers = refined(views, window, flight, markers, self.appearance, look)
        return without_bindings(markers, off_skis(views, window, markers, others)), others


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


def named_pulse(views: Views, candidates: PulseCandidates, rays: Integers, skis: MeasuredSkis) -> PulseMeasurements:
    """What was measured in the images of a pulse, by its candidates with their names.

    Args:
        views: the cameras.
        candidates: of the pulse.
        rays: (4, m) spot of each marker in each image; -1: none.
        skis: of the pulse.
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
        images[name] = ImageMeasurements(points, skis.get(name, {}))
    return PulseMeasurements(candidates.pulse, candidates.time, images)
