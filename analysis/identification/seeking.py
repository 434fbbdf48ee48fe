"""Seeks a jumper in candidates as they come, several times a second, so that one who comes into sight is followed.

Results for a pulse are kept for the next search, and so are tracks that turned out to be no jumper: a chance track of
snowflakes stays the same, while the jumper's own gets longer with every pulse.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.candidates.model import PulseCandidates, SecondLook
from analysis.identification.identify import appearance_of, sighted, stride
from analysis.identification.over_time.flights import Flight, find_flights, find_tracks
from analysis.identification.over_time.window import Window
from analysis.identification.space.space_points import SpacePoints
from analysis.identification.space.views import Views
from analysis.measurements.model import JumpMeasurements
from analysis.scene.camera_system import CameraSystem
from rig.pulse import PulseNumber

_Evidence = frozenset[tuple[int, ...]]  #: pulse and rays of all points of a flight's tracks


class Seeker:
    """Seeks a jumper in the last moments of one recording.

    Args:
        system: the oriented cameras.
        exposures_s: exposure time of each camera.
    """

    def __init__(self, system: CameraSystem, exposures_s: Mapping[str, float]) -> None:
        self._views = Views(system, exposures_s)
        self._points: dict[PulseNumber, SpacePoints] = {}
        self._due = PulseNumber(0)
        self._nobody: list[_Evidence] = []

    def seek(
        self, candidates: Sequence[PulseCandidates], rate_hz: float, more_than: int = 0, look: SecondLook | None = None
    ) -> JumpMeasurements | None:
        """The jumper who was seen last in the candidates of the last moments; None if nobody was.

        All cameras are taken to obey the trigger, and skis are sought where markers have names: as he is followed.

        Args:
            candidates: of pulses in order; those of pulses that were given before are the same.
            rate_hz: pulses per second.
            more_than: so many of his markers are known; if no more are named now, his skis are not worth a search.
            look: at their images, for his skis.
        """
        sought = self._sought(candidates, rate_hz)
        if not sought:
            return None
        time_s = np.array([float(c.pulse) for c in sought]) / rate_hz
        flights = find_flights(find_tracks([self._points[c.pulse] for c in sought], time_s))
        self._nobody = [known for known in self._nobody if max(known)[0] >= candidates[0].pulse]
        for flight in reversed(flights):
            evidence = _evidence(sought, flight)
            if any(evidence <= known for known in self._nobody):
                continue
            appearance = appearance_of(self._views, sought, flight)
            sighting = sighted(self._views, candidates, rate_hz, flight, appearance, on_time=True)
            if more_than and sighting.named() <= more_than:
                continue
            if pulses := sighting.measured(look, briefly=True):
                return JumpMeasurements(1, pulses)
            self._nobody.append(evidence)
        return None

    def _sought(self, candidates: Sequence[PulseCandidates], rate_hz: float) -> list[PulseCandidates]:
        """The candidates in which tracks are sought, with their points in space computed."""
        new = []
        for c in candidates:
            if c.pulse not in self._points and c.pulse >= self._due:
                new.append(c)
                self._due = PulseNumber(c.pulse + stride(rate_hz))
        points = Window(self._views, new, rate_hz).points if new else []
        self._points |= {c.pulse: of_pulse for c, of_pulse in zip(new, points, strict=True)}
        self._points = {pulse: of for pulse, of in self._points.items() if pulse >= candidates[0].pulse}
        return [c for c in candidates if c.pulse in self._points]


def _evidence(sought: Sequence[PulseCandidates], flight: Flight) -> _Evidence:
    return frozenset(
        (sought[step].pulse, *rays)
        for track in flight.tracks
        for step, rays in zip(track.step.tolist(), track.rays.tolist(), strict=True)
    )
