"""Follows a jumper from pulse to pulse: what the past predicts names the candidates of the next pulse.

The filter over time (`analysis.motion.causal`) predicts markers and skis, the candidates near them are assigned as in a
whole jump, and what was so measured goes into the filter. A jump that is over is identified once more as a whole: with
what comes after a pulse, more can be told of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from analysis.candidates.model import Expected, PulseCandidates, SecondLook
from analysis.identification.identify import named_pulse
from analysis.identification.markers.markers import Markers
from analysis.identification.over_time.assignment import MOST_VAGUE_M, assign, well_known
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.prediction import Prediction
from analysis.identification.over_time.window import Window
from analysis.identification.seeking import Seeker
from analysis.identification.ski_bars import MeasuredSkis, legs, ski_views
from analysis.identification.space.body import BINDINGS, HIP, REACH_M
from analysis.identification.space.space_points import Appearance
from analysis.identification.space.views import Views
from analysis.measurements.model import SIDES, JumpMeasurements, MeasuredCamera, PulseMeasurements
from analysis.motion.causal import CausalFilter
from analysis.procedure.names import measured_parts, told_names, told_state, untold_parts
from analysis.result.model import JumperState, SmoothedState, Status
from analysis.scene.camera_system import CameraSystem
from analysis.ski_bars.directions import HEADING_SIGMA, SLOPE_SIGMA
from analysis.worker.followed_skis import FollowedSkis
from rig.arrays import Flags, Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber

#: A jumper of whom nothing was measured for so long is not followed any more: his place is too uncertain.
_LOST_S: Final = 0.25
#: A marker is looked for within so many standard deviations of its prediction and so many of its radii.
_SIGMAS, _RADII = 4.0, 8.0
_FEWEST_CAMERAS: Final = 2  #: that must be able to see any of his markers
_BEGIN: Final = 4  #: pulses that show somebody before he is followed
#: Markers whose place is not known are sought after so long a time, then again whenever that time has doubled.
_HIDDEN_S: Final = 0.2
_AS_THEY_ARE, _EXCHANGED = [0, 1, 2, 3], [0, 1, 3, 2]  # indices of the markers, and with the other binding

_Part = TypeVar("_Part")


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """A pulse of a jumper who is followed.

    Attributes:
        pulse: its number.
        time: when it fired.
        state: of the jumper, from all pulses until this one, without markers whose names nothing bears out yet.
    """

    pulse: PulseNumber
    time: UtcNs
    state: SmoothedState


class Follower:
    """Follows one jumper.

    Attributes:
        first: the first pulse in which he was seen.
        last: the last one in which something was measured.
    """

    def __init__(self, system: CameraSystem, cameras: Mapping[str, MeasuredCamera], rate_hz: float) -> None:
        self._views = Views(system, {name: camera.exposure_s for name, camera in cameras.items()})
        self._filter = CausalFilter(system, cameras, rate_hz)
        self._skis = FollowedSkis()
        self._rate_hz = rate_hz
        self._appearance: Appearance | None = None
        self._next: tuple[UtcNs, tuple[SmoothedState, SmoothedState]] | None = None
        self._latest: SmoothedState | None = None
        self._pulse, self._time = PulseNumber(0), UtcNs(0)
        self._looks, self._look_at = 0, 0.0
        self._measured: list[JumperState] = []
        self._told = frozenset[str]()
        self.first = self.last = PulseNumber(0)

    def find(
        self, seeker: Seeker, candidates: Sequence[PulseCandidates], more_than: int = 0, look: SecondLook | None = None
    ) -> list[Followed]:
        """Begin with who is found in the candidates of the last moments.

        Args:
            seeker: of the recording.
            candidates: of these moments.
            more_than: so many of his markers are known: nobody is found who does not show more.
            look: at their images, for his skis.

        Returns:
            His states up to the last candidates; none if nobody is found.
        """
        found = seeker.seek(candidates, self._rate_hz, more_than, look)
        if found is None or len(found.pulses) < _BEGIN:
            return []
        states = self.begin(found, candidates)
        if states:
            states += [self.follow(later, look) for later in candidates if later.pulse > found.pulses[-1].pulse]
        return states

    def begin(self, found: JumpMeasurements, candidates: Sequence[PulseCandidates]) -> list[Followed]:
        """Begin with the pulses in which a jumper was found.

        Args:
            found: what was identified.
            candidates: in which it was identified.

        Returns:
            His states; none if the pulses are not enough to begin.
        """
        states = self._filter.begin(found.pulses)
        self._appearance = _appearance(self._views, found.pulses, candidates)
        pulses = found.pulses[len(found.pulses) - len(states) :]
        self.first, self._pulse = found.pulses[0].pulse, found.pulses[-1].pulse
        self.last, self._time = self._pulse, found.pulses[-1].time
        self._look_at = self._pulse + _HIDDEN_S * self._rate_hz
        self._learn_names(states)
        named = (told_state(state, self._told) for state in states)
        return [Followed(pulse.pulse, pulse.time, state) for pulse, state in zip(pulses, named, strict=True)]

    def expected(self, time: UtcNs) -> dict[str, Expected]:
        """Where each camera is expected to show him at a pulse; cameras that do not see him are left out."""
        _, state = self._predicted(time)
        xyz = np.array([_known(point).xyz for point in state.points.values()])
        covariance = np.array([_known(point).covariance for point in state.points.values()])
        places = np.concatenate((xyz, state.origin.value[None]))
        radius = 0.0 if self._appearance is None else self._appearance.radius
        found = {}
        moved = state.velocity.value * self._views.late_s[:, None, None]
        for k, whole in enumerate(self._views.see_all(places + moved)):
            name, scale = self._views.names[k], float(self._views.scale[k])
            sight = whole.only(slice(len(xyz)))
            spread = sight.by_point @ covariance @ sight.by_point.swapaxes(-1, -2) + sight.noise
            sigma = np.sqrt(np.linalg.eigvalsh(np.nan_to_num(spread, nan=1e6))[:, -1])
            reach = _SIGMAS * sigma + _RADII * radius * scale
            middle, half = whole.xy[len(xyz)], REACH_M * scale
            if np.isfinite(sight.xy).all() and np.isfinite(middle).all():
                box = np.stack((middle - half, middle + half))
                found[name] = Expected(sight.xy, reach, box)
        return found

    def follow(self, candidates: PulseCandidates, look: SecondLook | None = None) -> Followed:
        """Measure him at the next pulse, whose images are looked at for his skis."""
        views = self._views
        state, _ = self._predicted(candidates.time)
        flight = _flight(state, candidates.pulse / self._rate_hz)
        window = Window(views, [candidates], self._rate_hz, flight, self._appearance)
        points = [_known(point) for point in state.points.values()]
        places = Prediction(np.array([[p.xyz for p in points]]), np.array([[p.covariance for p in points]]))
        assigned = assign(views, window, places, flight.axes)
        markers = Markers(assigned, places)
        bindings, hips = markers.places(BINDINGS), markers.places(HIP)
        skis: MeasuredSkis = {}
        if look is not None:
            images = ski_views(views, window, flight, 0, look, legs(bindings.at(0), hips.at(0)))
            time_s = float(window.time_s[0])
            skis = self._skis.measured(time_s, images, bindings.at(0), _angles(state, flight), flight.axes)
        measured = named_pulse(views, window.candidates[0], assigned.rays[0], skis)
        found = self._filter.update(measured)
        if found is None:
            raise AssertionError("the filter has begun")
        if any(part is not None and part.status is not Status.PREDICTED for part in found.points.values()):
            self.last = candidates.pulse
        self._pulse, self._time, self._latest = candidates.pulse, candidates.time, found
        self._learn_names([found])
        return Followed(candidates.pulse, candidates.time, told_state(found, self._told))

    def _learn_names(self, states: Sequence[SmoothedState]) -> None:
        """Learn which names of markers more states bear out; what was told once is not taken back."""
        if untold_parts(self._told):
            self._measured += map(measured_parts, states)
            self._told |= told_names(self._measured)

    def hidden(self) -> int:
        """How many markers are somewhere unknown after the latest pulse."""
        return int(np.count_nonzero(~self._places()[1]))

    def look_is_due(self) -> bool:
        """Whether hidden markers should be sought at the latest pulse; if so, the next time is later and later."""
        if self._pulse < self._look_at:
            return False
        due = self.hidden() > 0
        self._looks = self._looks + 1 if due else 0
        self._look_at = self._pulse + _HIDDEN_S * 2 ** max(0, self._looks - 1) * self._rate_hz
        return due

    def continue_from(self, other: "Follower") -> None:
        """Go on in place of another one, who has followed the same jumper."""
        self.first = other.first

    def knows_more_than(self, other: "Follower") -> bool:
        """Whether this is the jumper whom another one follows, after the same pulse, with more of his markers.

        The other one may take each binding for the other: who sees one of them alone may err.
        """
        (mine, known), (theirs, also) = self._places(), other._places()
        if np.count_nonzero(known) <= np.count_nonzero(also):
            return False
        for names in (_AS_THEY_ARE, _EXCHANGED):
            both = known & also[names]
            apart = np.linalg.norm(mine - theirs[names], axis=1)[both]
            if both.any() and (apart < MOST_VAGUE_M).all():
                return True
        return False

    def _places(self) -> tuple[Floats, Flags]:
        """Places (4, 3) of the markers after the latest pulse, and which are known (4,)."""
        state = self._latest
        if state is None or None in state.points.values():
            state, _ = _known(self._filter.predicted(self._time))
        points = [_known(point) for point in state.points.values()]
        known = well_known(np.array([point.covariance for point in points]))
        return np.array([point.xyz for point in points]), known

    def lost(self, pulse: PulseNumber, time: UtcNs) -> bool:
        """Whether he is followed no more at a pulse: nothing was measured for too long, or he has left the images."""
        if pulse - self.last > _LOST_S * self._rate_hz:
            return True
        state, _ = self._predicted(time)
        xyz = np.array([_known(point).xyz for point in state.points.values()])
        seeing = sum(bool(self._views.inside(k, xyz).any()) for k in range(len(self._views)))
        return seeing < _FEWEST_CAMERAS

    def _predicted(self, time: UtcNs) -> tuple[SmoothedState, SmoothedState]:
        """`CausalFilter.predicted`, computed once for each pulse."""
        if self._next is None or self._next[0] != time:
            self._next = time, _known(self._filter.predicted(time))
        return self._next[1]


def _appearance(
    views: Views, pulses: Sequence[PulseMeasurements], candidates: Sequence[PulseCandidates]
) -> Appearance | None:
    """What the markers look like, by the spots that show them; None if they are known by second looks alone."""
    seen = []
    of_pulse = {pulse.pulse: pulse for pulse in pulses}
    for at in candidates:
        for k, name in enumerate(views.names):
            if at.pulse not in of_pulse or name not in at.images or name not in of_pulse[at.pulse].images:
                continue
            spots = at.images[name].spots
            for point in of_pulse[at.pulse].images[name].points.values():
                for i in np.flatnonzero((spots.xy == point.xy).all(axis=1)):
                    seen.append((float(spots.contrast[i]), float(spots.radius[i] / views.scale[k])))
    return Appearance.of(*np.array(seen).T) if seen else None


def _flight(state: SmoothedState, time_s: float) -> Flight:
    """The flight as it goes on from a state."""
    velocity = state.velocity.value
    forward = np.array((velocity[0], velocity[1], 0.0)) / np.hypot(velocity[0], velocity[1])
    up = np.array((0.0, 0.0, 1.0))
    motion = np.stack((state.origin.value, velocity, np.zeros(3)))
    return Flight(time_s, time_s, time_s, motion, np.stack((forward, np.cross(up, forward), up)), ())


def _angles(state: SmoothedState, flight: Flight) -> Prediction:
    """Slope and heading of both skis in the frame of the flight, rad; along the flight if they are unknown."""
    course = np.degrees(np.arctan2(flight.axes[0, 1], flight.axes[0, 0]))
    values, covariance = np.zeros((1, 2, 2)), np.tile(np.diag((SLOPE_SIGMA**2, HEADING_SIGMA**2)), (1, 2, 1, 1))
    for i, side in enumerate(SIDES):
        if (ski := state.skis[side]) is None:
            continue
        values[0, i] = ski.slope.value, (ski.heading.value - course + 180.0) % 360.0 - 180.0
        covariance[0, i] = ski.covariance
    return Prediction(np.radians(values), covariance)


def _known(part: _Part | None) -> _Part:
    if part is None:
        raise AssertionError("a predicted state has all points")
    return part
