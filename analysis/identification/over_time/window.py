"""The pulses in which one jumper may be in sight: their candidates, as rays and as points in space."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis.candidates.model import ImageCandidates, PulseCandidates, Spots
from analysis.identification.over_time.flights import Flight
from analysis.identification.space.body import REACH_M
from analysis.identification.space.space_points import Appearance, Rays, find_space_points, rays_of
from analysis.identification.space.views import Views
from rig.arrays import Flags, Floats, Integers

_MOST_SPOTS = 60  #: of an image, in the search for a jumper; the strongest of a snowfall
_REACH = 1.5  #: times a body's length: further from the path nothing belongs to it, even if it is nearer to the camera
_SAME_PX = 1.0  #: spots that are nearer to each other than this are one


class Window:
    """Candidates of t pulses.

    Attributes:
        time_s: (t,) of the pulses, since pulse 0.
        candidates: of the pulses, with what second looks have found.
        rays: their spots, of each pulse by camera.
        points: in space, that these spots may show.
        delivered: (t, m) whether a camera has an image of a pulse.
        late_s: (m,) how much later than the mean of all cameras each one shows the jumper.
        shift: (t, m, 2) px, moves the jumper in an image to where he was at the common time.
    """

    def __init__(
        self,
        views: Views,
        candidates: Sequence[PulseCandidates],
        rate_hz: float,
        flight: Flight | None = None,
        appearance: Appearance | None = None,
        late_s: Floats | None = None,
    ) -> None:
        """Prepare the candidates.

        Args:
            views: the cameras.
            candidates: of the pulses.
            rate_hz: pulses per second.
            flight: of the jumper, where it is known.
            appearance: of his markers, likewise.
            late_s: (m,) how much later than the others each camera shows him, apart from its exposure time.
        """
        self._views, self._appearance, self._flight, self._rate_hz = views, appearance, flight, rate_hz
        self.candidates = list(candidates)
        self.time_s: Floats = np.array([float(c.pulse) for c in candidates]) / rate_hz
        self.late_s = late = views.late_s if late_s is None else views.late_s + late_s
        self.shift = np.zeros((len(candidates), len(views), 2))
        self._path = np.full(self.shift.shape, np.nan)
        if flight is not None:
            for k, sight in enumerate(views.see_all(flight.place(self.time_s))):
                moved = np.einsum("tij,tj->ti", sight.by_point, flight.velocity(self.time_s)) * late[k]
                self.shift[:, k] = -np.nan_to_num(moved)
                self._path[:, k] = sight.xy
        self.rays = self._rays(range(len(self.candidates)))
        self.points = find_space_points(views, self.rays)
        self.delivered: Flags = np.array([[name in c.images for name in views.names] for c in candidates], bool)

    def _rays(self, order: Sequence[int]) -> list[list[Rays]]:
        """The spots of some pulses; those that no body reaches, or too many to compare, are there but of no use."""
        found = rays_of(self._views, [self.candidates[t] for t in order], self._appearance, self.shift[list(order)])
        for t, rays in zip(order, found, strict=True):
            for k, (name, of_camera) in enumerate(zip(self._views.names, rays, strict=True)):
                if self._flight is not None:
                    reach = _REACH * REACH_M * self._views.scale[k]
                    useless = ~(np.linalg.norm(of_camera.xy - self._path[t, k], axis=1) < reach)
                elif len(of_camera.xy) > _MOST_SPOTS:
                    strength = self.candidates[t].images[name].spots.strength
                    useless = strength < np.sort(strength)[-_MOST_SPOTS]
                else:
                    continue
                of_camera.variance[useless] = np.inf
        return found

    def part(self, chosen: Integers) -> Callable[[Floats], "Window"]:
        """Makes windows of some of its pulses with other times of the cameras, (m,) s as in the constructor."""
        candidates = [self.candidates[t] for t in chosen.tolist()]
        return lambda late_s: Window(self._views, candidates, self._rate_hz, self._flight, self._appearance, late_s)

    def __len__(self) -> int:
        return len(self.candidates)

    def add(self, found: Mapping[tuple[int, int], Sequence[Spots]]) -> bool:
        """Add spots of second looks, by pulse and camera; returns whether any is new."""
        changed = set()
        for (t, k), spots in found.items():
            image = self.candidates[t].images[self._views.names[k]]
            more = _new(image.spots, spots)
            if len(more) > len(image.spots):
                self.put(t, k, more)
                changed.add(t)
        self.renew(sorted(changed))
        return bool(changed)

    def put(self, t: int, k: int, spots: Spots) -> None:
        """Replace the spots of an image; `renew` makes rays and points of them."""
        name = self._views.names[k]
        images = {**self.candidates[t].images, name: ImageCandidates(spots)}
        self.candidates[t] = replace(self.candidates[t], images=images)

    def renew(self, order: Sequence[int]) -> None:
        """Make rays and points in space of the spots of some pulses."""
        for t, rays in zip(order, self._rays(order), strict=True):
            self.rays[t] = rays
        for t, points in zip(order, find_space_points(self._views, [self.rays[t] for t in order]), strict=True):
            self.points[t] = points


def _new(known: Spots, found: Sequence[Spots]) -> Spots:
    """Known spots and those found that are none of them."""
    for spots in found:
        for i in range(len(spots)):
            if not len(known) or np.linalg.norm(known.xy - spots.xy[i], axis=1).min() > _SAME_PX:
                known = Spots.joined([known, spots.only(np.array([i]))])
    return known
