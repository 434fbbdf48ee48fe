"""Measures the spots of named markers again as what they are: discs of one size, smeared by the flight, partly covered.

Before there are names, a spot is anything symmetric, and what is left of a half covered marker is a spot whose centre
lies on the visible side. The markers of a jumper are alike, and most of them are in full view: these tell the size.
Their light is told by the spots of each, where one is in the shade. What is hardly ever such a disc is no marker: a
face, where the helmet has none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.markers.disc_profiles import BLUR_PX
from analysis.candidates.markers.known_discs import DiscShape
from analysis.candidates.model import SecondLook, Spots
from analysis.identification.markers.markers import ANYWHERE_M, Markers, settled_again
from analysis.identification.over_time.assignment import well_known
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.space.body import BINDINGS
from analysis.identification.space.space_points import Appearance
from analysis.identification.space.views import Sight, Views
from analysis.measurements.model import POINTS
from rig.arrays import Flags, Floats, Integers

_SPREAD = 0.04  #: standard deviation of the logarithm of a marker's radius: they are made alike, cloth bends them
#: Least spots: of a marker for its size; of a camera for a size of its own, else that of all cameras is taken; and
#: expected discs of a marker from which on their absence says that it is not worn.
_FEW = 6
_LIT = 0.75  #: share of the brightest marker's contrast from which on a marker may be in full view
_SMALLEST_PX = 0.5  #: a smaller radius cannot be told from the blur
_NEAR = 1.5  #: radii from a predicted place to a spot that may be the marker's
_SURE = 1.5  #: radii: around a less certain prediction, a disc may belong to another marker
_ITSELF = 0.25  #: radii from a spot to its own disc, at most; a farther disc is another thing
_MOST = 0.5  #: of the spots of a marker are discs


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """n places in the images of one camera.

    Attributes:
        step: (n,) index of the pulse.
        spot: (n,) index of the spot there; -1: a predicted place without a spot.
        marker: (n,) index of the marker that is expected there.
        named: (n,) whether the spot has its name.
        xy: (n, 2) px in the image.
        radius: (n,) px, expected.
        streak: (n, 2) px.
    """

    step: Sequence[int]
    spot: Sequence[int]
    marker: Integers
    named: Flags
    xy: Floats
    radius: Floats
    streak: Floats

    def only_named(self) -> "_Places":
        """Those at spots with a name."""
        at = np.flatnonzero(self.named)
        step, spot = ([of[i] for i in at.tolist()] for of in (self.step, self.spot))
        return _Places(step, spot, self.marker[at], self.named[at], self.xy[at], self.radius[at], self.streak[at])


def refined(
    views: Views, window: Window, flight: Flight, markers: Markers, appearance: Appearance, look: SecondLook
) -> Markers:
    """Fit discs of the markers' size to their spots, and where markers are expected; then name them again.

    The spots of the window are replaced: covered ones move to where their whole disc is. Markers that are not worn lose
    their names.
    """
    changed: set[int] = set()
    seen = _Seen()
    for k, places, discs in _fits(views, window, flight, markers, appearance, look):
        seen.add(places, discs)
        for t in sorted(set(places.step)):
            own = np.flatnonzero(np.array(places.step) == t)
            spots = window.candidates[t].images[views.names[k]].spots
            window.put(t, k, _replaced(spots, places, discs, own, appearance.contrast))
            changed.add(t)
    window.renew(sorted(changed))
    worn = seen.worn()
    return _only(settled_again(views, window, flight, _only(markers, worn)), worn)


def only_worn(
    views: Views, window: Window, flight: Flight, markers: Markers, appearance: Appearance, look: SecondLook
) -> Markers:
    """The markers without the names of those that are not worn, as in `refined`; nothing is measured again."""
    seen = _Seen()
    for _, places, discs in _fits(views, window, flight, markers, appearance, look, named=True):
        seen.add(places, discs)
    return _only(markers, seen.worn())


def _fits(
    views: Views,
    window: Window,
    flight: Flight,
    markers: Markers,
    appearance: Appearance,
    look: SecondLook,
    *,
    named: bool = False,
) -> Iterator[tuple[int, _Places, Spots]]:
    """By camera (its index): places and the discs that are fitted near them; `named`: only at spots with names."""
    sights = views.see_all(markers.predicted.xyz.reshape(-1, 3))
    for k, radius in enumerate(_radii(views, window, flight, markers, sights)):
        places = _places(views, window, flight, markers, k, sights[k], radius)
        if named:
            places = places.only_named()
        if len(places.xy):
            shape = DiscShape(places.radius, _SPREAD, places.streak, appearance.contrast, appearance.sigma)
            yield k, places, _fitted(views, window, k, places, shape, look)


class _Seen:
    """How many named spots of each marker are discs."""

    def __init__(self) -> None:
        self._spots, self._discs = np.zeros(len(POINTS)), np.zeros(len(POINTS))

    def add(self, places: _Places, discs: Spots) -> None:
        """Count those of a camera."""
        self._spots += np.bincount(places.marker[places.named], minlength=len(POINTS))
        self._discs += np.bincount(places.marker[places.named & _itself(places, discs)], minlength=len(POINTS))

    def worn(self) -> Flags:
        """Which markers (4,) the jumper wears.

        In some pictures hardly any marker can be fitted as a disc. Then helmet and hip are judged only by many spots,
        and bindings not at all. Elsewhere the bindings are compared with each other, since legs cover both.
        """
        share = self._discs / np.maximum(self._spots, 1.0)
        enough = self._spots >= _FEW
        usual = np.full(len(POINTS), np.median(share[enough]) if enough.any() else 0.0)
        usual[BINDINGS] = np.where(enough[BINDINGS[::-1]], share[BINDINGS[::-1]], usual[BINDINGS])
        many = usual * self._spots >= _FEW
        many[BINDINGS] = False
        tells = (usual >= _MOST) | many
        return np.asarray(~enough | (share >= _MOST * usual) | ~tells)


def _fitted(views: Views, window: Window, k: int, places: _Places, shape: DiscShape, look: SecondLook) -> Spots:
    """A disc near each place, NaN where there is none; a marker that is hardly found may get its own contrast."""
    name = views.names[k]
    pulses = np.array([window.candidates[t].pulse for t in places.step])
    discs = look.fit_discs(pulses.tolist(), name, places.xy, shape)
    for i in range(len(POINTS)):
        named, own = places.named & (places.marker == i), np.flatnonzero(places.marker == i)
        count = np.count_nonzero(named & _itself(places, discs))
        if named.sum() < _FEW or count >= _MOST * named.sum():
            continue
        at = np.flatnonzero(named).tolist()
        images = [(window.candidates[places.step[p]].images[name].spots, places.spot[p]) for p in at]
        light = float(np.median([spots.contrast[s] for spots, s in images]))
        other = replace(
            shape.of(own), contrast=light, sigma_contrast=shape.sigma_contrast * abs(light / shape.contrast)
        )
        again = _with(discs, own, look.fit_discs(pulses[own].tolist(), name, places.xy[own], other))
        if np.count_nonzero(named & _itself(places, again)) > count:
            discs = again
    return discs


def _itself(places: _Places, discs: Spots) -> Flags:
    """Whether each place (n,) itself shows a disc, not a thing beside it."""
    away = np.linalg.norm(discs.xy - places.xy, axis=1)
    return np.asarray(np.nan_to_num(away, nan=np.inf) < _ITSELF * places.radius)


def _with(discs: Spots, chosen: Integers, others: Spots) -> Spots:
    """The discs with others in place of the chosen ones."""
    kept = np.delete(np.arange(len(discs)), chosen)
    order = np.argsort(np.concatenate((kept, chosen)))
    return Spots.joined([discs.only(kept), others]).only(order)


def _only(markers: Markers, worn: Flags) -> Markers:
    """The markers without the names of those that are not worn (4,); their predicted places become unknown."""
    rays, xyz = markers.assigned.rays.copy(), markers.assigned.xyz.copy()
    rays[:, ~worn], xyz[:, ~worn] = -1, np.nan
    covariance = markers.predicted.covariance.copy()
    covariance[:, ~worn] = ANYWHERE_M**2 * np.eye(3)
    predicted = replace(markers.predicted, covariance=covariance)
    return Markers(replace(markers.assigned, rays=rays, xyz=xyz), predicted)


def _radii(views: Views, window: Window, flight: Flight, markers: Markers, sights: Sequence[Sight]) -> list[float]:
    """Radius of the markers, m, in each camera: the median over the spots of a marker in full view."""
    found: list[tuple[Floats, Floats, Integers]] = []
    for k, (name, sight) in enumerate(zip(views.names, sights, strict=True)):
        steps, which = np.nonzero(markers.assigned.rays[..., k] >= 0)
        spots = markers.assigned.rays[steps, which, k]
        of_image = [window.candidates[t].images[name].spots for t in steps.tolist()]
        seen = np.array([(of.radius[s], of.contrast[s]) for of, s in zip(of_image, spots.tolist(), strict=True)])
        radius, contrast = seen.reshape(-1, 2).T
        at = steps * len(POINTS) + which
        streak = _streaks(views, window, flight, k, sight, at)
        # A streak makes the spot longer, and with it the radius of the disc of the same area.
        more = (streak**2).sum(axis=1) / 12
        size = (np.sqrt(more**2 + 4 * (radius**2 / 4 + BLUR_PX**2) ** 2) - more) / 2
        px = 2 * np.sqrt(np.maximum(size - BLUR_PX**2, _SMALLEST_PX**2 / 4))
        found.append((px / _scale(sight)[at], contrast, which))
    everywhere = radius_in_full_view(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
    return [radius_in_full_view(*of) if len(of[0]) >= _FEW else everywhere for of in found]


def radius_in_full_view(radius: Floats, contrast: Floats, which: Integers) -> float:
    """Radius of the markers out of those of n spots, their contrasts and their markers.

    A covered marker has smaller and fainter spots, perhaps in most pulses; one beside a thing of its own grey value has
    larger ones. So the result is the second largest median of those markers that are nearly as bright as the brightest.
    """
    own = [which == i for i in range(len(POINTS)) if np.count_nonzero(which == i) >= _FEW]
    if not own:
        return float(np.median(radius)) if len(radius) else np.nan
    light = np.array([abs(np.median(contrast[of])) for of in own])
    medians = [
        float(np.median(radius[of])) for of, enough in zip(own, light >= _LIT * light.max(), strict=True) if enough
    ]
    return sorted(medians)[-2:][0]


def _scale(sight: Sight) -> Floats:
    """(n,) px per m."""
    return np.asarray(np.linalg.norm(np.nan_to_num(sight.by_point), ord=2, axis=(1, 2)))


def _streaks(views: Views, window: Window, flight: Flight, k: int, sight: Sight, at: Integers) -> Floats:
    """(n, 2) px that the images of markers move during the exposure; at (n,): pulse and marker as one index."""
    velocity = flight.velocity(window.time_s)[at // len(POINTS)]
    return np.asarray(np.einsum("nij,nj->ni", np.nan_to_num(sight.by_point[at]), velocity) * views.exposure_s[k])


def _places(
    views: Views, window: Window, flight: Flight, markers: Markers, k: int, sight: Sight, radius: float
) -> _Places:
    """Spots that have a name or lie where a marker is expected, and expected places without any."""
    n = len(POINTS)
    known = well_known(markers.predicted.covariance) & window.delivered[:, k, None]
    spread = sight.by_point @ markers.predicted.covariance.reshape(-1, 3, 3) @ sight.by_point.swapaxes(-1, -2)
    px = radius * _scale(sight)
    sure = np.sqrt(np.trace(spread, axis1=1, axis2=2) / 2) < _SURE * px
    found: list[tuple[int, int, int, Floats]] = []
    for t, i in np.argwhere(known & sight.inside.reshape(-1, n)).tolist():
        at = t * n + i
        spots = window.candidates[t].images[views.names[k]].spots
        place, named = sight.xy[at] - window.shift[t, k], int(markers.assigned.rays[t, i, k])
        if named < 0 and not sure[at]:
            continue
        near = [named] if named >= 0 else np.flatnonzero(np.linalg.norm(spots.xy - place, axis=1) < _NEAR * px[at])
        found += [(t, int(s), at, spots.xy[s]) for s in near]
        if not len(near):
            found.append((t, -1, at, place))
    where = np.array([at for _, _, at, _ in found], int)
    return _Places(
        [t for t, _, _, _ in found],
        [s for _, s, _, _ in found],
        where % n,
        np.array([s >= 0 and s == markers.assigned.rays[t, at % n, k] for t, s, at, _ in found], bool),
        np.array([xy for _, _, _, xy in found]).reshape(-1, 2),
        np.maximum(px[where], _SMALLEST_PX),
        _streaks(views, window, flight, k, sight, where),
    )


def _replaced(spots: Spots, places: _Places, discs: Spots, own: Integers, contrast: float) -> Spots:
    """The spots of an image with those discs instead that were found; a spot that is no disc is less certain."""
    spots = spots.only(np.arange(len(spots)))
    new: list[int] = []
    moved = np.nan_to_num(np.linalg.norm(discs.xy[own] - places.xy[own], axis=1), nan=np.inf)
    for i in own[np.argsort(moved)].tolist():
        s, radius = places.spot[i], float(places.radius[i])
        if not np.isfinite(discs.xy[i]).all():
            if s >= 0:
                light = float(spots.contrast[s]) / contrast
                spots.covariance[s] += off_centre(float(spots.radius[s]), radius, light) ** 2 * np.eye(2)
            continue
        others = np.delete(spots.xy, s, axis=0) if s >= 0 else spots.xy
        if len(others) and np.linalg.norm(others - discs.xy[i], axis=1).min() < radius / 2:
            continue
        if s < 0:
            new.append(i)
            continue
        for mine, fitted in zip(
            (spots.xy, spots.covariance, spots.radius, spots.contrast, spots.strength),
            (discs.xy, discs.covariance, discs.radius, discs.contrast, discs.strength),
            strict=True,
        ):
            mine[s] = fitted[i]
    return Spots.joined([spots, discs.only(np.array(new, int))]) if new else spots


def off_centre(shown: float, radius: float, light: float) -> float:
    """How far the centre of a disc may be from that of a spot which shows a part of it, or more than it, px.

    A spot of the same area as what a chord leaves of the disc is so much narrower; in a larger spot the disc may lie
    at any border. Where a disc is hardly larger than the blur, what is left of it looks as large as all of it, but its
    light goes with its area: of a disc with a share s in sight the middle of the rest is off by (1 - s) radii, nearly.

    Args:
        shown: radius of the spot, px.
        radius: of the disc, px.
        light: contrast of the spot by that of whole markers.
    """
    return max(radius - shown**2 / radius, shown - radius, (1.0 - max(light, 0.0)) * radius, 0.0)
