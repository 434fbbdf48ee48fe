"""Carries a thing that was marked by hand through the pulses, in all cameras together.

From pulse to pulse the motion predicts an ellipse in each image; a template of the thing is searched there and matched
by least squares; and the matches of all cameras have to agree, with each other and with the prediction, by chi-squared.
What the automatic measurement found is taken instead of a match where it agrees. A mark by hand that is met on the way
is taken as it is. The track ends where no image shows the thing any more, or where chi-squared is exceeded; it
says which. A place that was only predicted is never given out.
"""

from collections.abc import Callable, Mapping

import numpy as np

from analysis.candidates.foreground.background import Background
from analysis.digitizing.following.points.motion import KnownMotion, Motion
from analysis.digitizing.following.points.run import Run
from analysis.digitizing.following.points.thing_template import Picture
from analysis.digitizing.following.points.tracks import Automatic, Frames, Mark, Track
from analysis.digitizing.following.points.views import ImageView, SpaceViews, Views
from analysis.scene.camera_system import CameraSystem
from analysis.scene.static_image import spatial_noise, static_image
from rig.errors import BadInputError
from rig.images.picture import Grey
from rig.phrase import phrase

_BODY_M_S = 5.0  # standard deviation of the velocity of one part of a jumper against another
_BACKGROUND = 9  # frames of which the static background is made


class Tracker:
    """Tracks the things of one recording.

    Args:
        frames: gives the images (rows, columns) of a pulse by camera; without those that are missing, none for pulses
            that there are not.
        rate_hz: pulses per second.
        system: the oriented cameras; None if there are none.
        background: the static scene by camera; made of frames around the track if left out.
        late_s: by camera, how much later than those of the others its exposures are, s.
        step: called at every pulse of every thing.
    """

    def __init__(
        self,
        frames: Frames,
        rate_hz: float,
        system: CameraSystem | None = None,
        background: Mapping[str, Background] | None = None,
        late_s: Mapping[str, float] | None = None,
        step: Callable[[], None] = lambda: None,
    ) -> None:
        self._frames, self._rate_hz, self._system = frames, rate_hz, system
        self._background = background
        self._late, self._step = late_s or {}, step
        self._noise: dict[str, float] = {}

    def track(
        self,
        marks: Mapping[int, Mapping[str, Mark]],
        pulse: int,
        direction: int,
        most: int,
        automatic: Automatic | None = None,
        known: KnownMotion | None = None,
    ) -> list[Track]:
        """Track a thing away from a pulse at which it is marked.

        Oriented cameras that show it at the start are tracked together, every other one by itself.

        Args:
            marks: of the thing by hand, by pulse and camera; those of the pulses on the way too.
            pulse: where to start.
            direction: 1 forward, -1 backward.
            most: pulses to go.
            automatic: gives what the automatic measurement found of it at a pulse, by camera.
            known: what is known of its motion, for example from another thing of the same jumper.

        Returns:
            A track of the cameras that go together, if there are any, and one of each other camera.

        Raises:
            BadInputError: nothing is marked there, or the marks contradict each other.
        """
        if not marks.get(pulse):
            raise BadInputError(
                phrase(
                    "hand_not_marked",
                    "pulse {pulse}: the thing is not marked there: mark it, best in two images",
                    pulse=pulse,
                )
            )
        oriented = tuple(name for name in (self._system.names if self._system else ()) if name in marks[pulse])
        groups: list[Views] = []
        if self._system is not None and len(oriented) > 1:
            groups.append(SpaceViews(self._system, oriented))
        apart = [name for name in marks[pulse] if not groups or name not in oriented]
        groups += [ImageView((name,)) for name in apart]
        pulses = range(pulse, pulse + direction * (most + 1), direction)
        if self._background is None:
            self._background = self._static(pulses)
        motions = [Motion(views, 1 / self._rate_hz, self._late) for views in groups]
        return [Run(self._pictures, motion, marks, pulses, automatic, known, self._step).track() for motion in motions]

    def track_together(
        self,
        marks: Mapping[str, Mapping[int, Mapping[str, Mark]]],
        pulse: int,
        direction: int,
        most: int,
        automatic: Mapping[str, Automatic] | None = None,
    ) -> dict[str, list[Track]]:
        """Track several things of one jumper: the first that is tracked in space tells the others how fast they are.

        Args:
            marks: of each thing, as for `track`.
            pulse: where to start; things that are not marked there are left out.
            direction: 1 forward, -1 backward.
            most: pulses to go.
            automatic: of each thing, as for `track`; things that are not named have none.

        Returns:
            Tracks of each thing, as `track` gives them.

        Raises:
            BadInputError: nothing is marked there, or the marks of a thing contradict each other.
        """
        there = [thing for thing in marks if marks[thing].get(pulse)]
        if not there:
            raise BadInputError(
                phrase(
                    "hand_nothing_there",
                    "pulse {pulse}: nothing is marked there: mark a thing, best in two images",
                    pulse=pulse,
                )
            )

        def tracked(thing: str, known: KnownMotion | None) -> list[Track]:
            return self.track(marks[thing], pulse, direction, most, (automatic or {}).get(thing), known)

        tracks = {thing: tracked(thing, None) for thing in there}
        longest = max((of[0] for of in tracks.values() if of[0].velocity is not None), key=_length, default=None)
        if longest is not None and longest.velocity is not None:
            known = KnownMotion(longest.velocity, _BODY_M_S)
            for thing in there:
                if _length(tracks[thing][0]) < _length(longest):
                    again = tracked(thing, known)
                    tracks[thing] = max(tracks[thing], again, key=lambda of: _length(of[0]))
        return tracks

    def _pictures(self, pulse: int) -> dict[str, Picture]:
        """The images of a pulse to look in, by camera."""
        out = {}
        for name, image in self._frames(pulse).items():
            if name not in self._noise:
                self._noise[name] = spatial_noise(image)
            background = (self._background or {}).get(name)
            if background is None:
                out[name] = Picture(image.astype(np.float32), None, self._noise[name])
            else:
                grey, behind, shift = background.relit(image)
                out[name] = Picture(grey, behind, self._noise[name], shift)
        return out

    def _static(self, pulses: range) -> dict[str, Background]:
        """The static scene in frames spread over the track; of cameras that have enough of them."""
        spread = pulses[:: max(1, len(pulses) // _BACKGROUND)]
        stacks: dict[str, list[Grey]] = {}
        for pulse in spread:
            for name, image in self._frames(pulse).items():
                stacks.setdefault(name, []).append(image)
        return {
            name: Background(static_image(name, images))
            for name, images in stacks.items()
            if len(images) >= _BACKGROUND // 2
        }


def _length(track: Track) -> int:
    return len(track.places)
