"""One thing, tracked from pulse to pulse in cameras that go together."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.special import chdtri

from analysis.digitizing.following.points.agreement import GATE_P, agreeing
from analysis.digitizing.following.points.candidates import Anchor, Candidate, of_automatic, of_images
from analysis.digitizing.following.points.motion import Belief, KnownMotion, Motion, mark_observation
from analysis.digitizing.following.points.thing_template import Picture
from analysis.digitizing.following.points.tracks import FAR, Automatic, Mark, Track, Tracked, one_after_another
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

_GAP = 2  # pulses without any match that are bridged
_PULSES_ALONE = 4  # pulses in sequence in which one camera alone may show a thing that several cameras track
_STRAINED_P = 0.05  # probability of those from which on places are taken back when they become too large
_MEMORY = 8  # pulses back in which further marks tell of the motion


class Run:
    """The tracking of one thing.

    Args:
        pictures: gives the images of a pulse by camera.
        motion: of the thing, in its cameras.
        marks: by hand, by pulse and camera.
        pulses: from the first one on, which is marked.
        automatic: what the automatic measurement found of it at a pulse, by camera.
        known: what is known of its motion.
        step: called at every pulse.
    """

    def __init__(
        self,
        pictures: Callable[[int], Mapping[str, Picture]],
        motion: Motion,
        marks: Mapping[int, Mapping[str, Mark]],
        pulses: range,
        automatic: Automatic | None,
        known: KnownMotion | None,
        step: Callable[[], None],
    ) -> None:
        self._step = step
        self._pictures, self._motion, self._views, self._pulses = pictures, motion, motion.views, pulses
        names = motion.views.names
        self._marks = {pulse: {name: of[name] for name in names if name in of} for pulse, of in marks.items()}
        self._automatic, self._known = automatic, known
        self._anchors: dict[str, Anchor] = {}
        self._places: dict[int, dict[str, Tracked]] = {}
        self._strained: list[int] = []  # the last pulses in which the offsets of the cameras were doubtful

    def track(self) -> Track:
        """Start and go on until the end, or until something speaks against it."""
        belief = self._started()
        stopped, gap, alone = FAR, 0, 0
        velocity = None
        for pulse in self._pulses[1:]:
            self._step()
            belief = self._motion.predicted(belief, self._pulses.step)
            after, seen, reason = self._at(belief, pulse)
            if after is None:
                stopped = phrase("hand_at_pulse", "pulse {pulse}: {why}", pulse=pulse, why=reason)
                break
            belief = after
            gap = 0 if seen else gap + 1
            alone = alone + 1 if seen == 1 and len(self._views.names) > 1 else 0
            if not gap and velocity is None and self._views.dimensions == 3:
                velocity = self._motion.velocity(belief)
            if gap > _GAP or alone > _PULSES_ALONE:
                stopped = phrase("hand_at_pulse", "pulse {pulse}: {why}", pulse=pulse, why=reason)
                break
        shown = [pulse for pulse in self._pulses if pulse in self._places]
        return Track(self._places, stopped, shown[-1] if shown else self._pulses[0], velocity)

    def _started(self) -> Belief:
        """The belief at the first pulse, from its marks and those shortly before."""
        first, step = self._pulses[0], self._pulses.step
        before = [p for p in range(first - _MEMORY * step, first, step) if len(self._marks.get(p, {})) >= self._least]
        marked = [*before, first]
        marks = self._marks[marked[0]]
        xy, sigma = (
            {k: mark.xy for k, mark in marks.items()},
            {k: float(mark.sigma.mean()) for k, mark in marks.items()},
        )
        belief = self._motion.begun(self._views.place(xy, sigma), self._known)
        for previous, pulse in zip((marked[0], *marked), marked, strict=False):
            marks = self._marks[pulse]
            if pulse != previous:
                belief = self._motion.predicted(belief, pulse - previous)
            belief, square = self._with_marks(belief, pulse, marks)
            if not square <= chdtri(2 * len(marks), GATE_P):
                raise BadInputError(
                    phrase(
                        "hand_marks_contradict",
                        "pulse {pulse}: the marks of {cameras} contradict each other or those before "
                        "(chi-squared {square:.0f}): correct them",
                        pulse=pulse,
                        cameras=", ".join(marks),
                        square=square,
                    )
                )
        self._anchor(belief, first, self._marks[first])
        return belief

    @property
    def _least(self) -> int:
        return 2 if self._views.dimensions == 3 else 1

    def _with_marks(self, belief: Belief, pulse: int, marks: Mapping[str, Mark]) -> tuple[Belief, float]:
        anchored = self._motion.anchored(belief, {name: np.diag(mark.sigma**2) for name, mark in marks.items()})
        pictures, still = self._pictures(pulse), np.zeros(2)
        shifts = {name: pictures[name].shift if name in pictures else still for name in marks}
        return self._motion.updated(
            anchored, {name: mark_observation(mark.xy, shifts[name]) for name, mark in marks.items()}
        )

    def _anchor(self, belief: Belief, pulse: int, marks: Mapping[str, Mark]) -> None:
        """Take the templates of cameras from their marks."""
        pictures = self._pictures(pulse)
        place = self._motion.place(belief)
        for name, mark in marks.items():
            if name in pictures:
                scale = self._views.px_per_m(name, place)
                self._anchors[name] = Anchor.at_mark(pictures[name], mark.xy, np.diag(mark.sigma**2), scale)

    def _at(self, belief: Belief, pulse: int) -> tuple[Belief | None, int, Phrase]:
        """The belief after a pulse, None if something contradicts; how many images show the thing; what is missing."""
        marks = self._marks.get(pulse, {})
        if marks:
            belief, square = self._with_marks(belief, pulse, marks)
            if not square <= chdtri(2 * len(marks), GATE_P):
                return (
                    None,
                    0,
                    phrase(
                        "hand_marks_off_track",
                        "the marks of {cameras} contradict the track (chi-squared {square:.0f})",
                        cameras=", ".join(marks),
                        square=square,
                    ),
                )
        candidates, missing = self._candidates(belief, pulse, [name for name in self._views.names if name not in marks])
        after, chosen, reason = agreeing(self._motion, belief, candidates)
        if after is None:
            return None, 0, reason
        if chosen:
            self._places[pulse] = {}
        for name, candidate in chosen.items():
            after = self._motion.stepped(after, name, candidate.step)
            if candidate.anchor is not None:
                self._anchors[name] = candidate.anchor
            self._places[pulse][name] = Tracked(candidate.observation.xy, candidate.sigma, candidate.origin)
        if marks:
            self._anchor(after, pulse, marks)
        anchors = {name: anchor.covariance for name, anchor in self._anchors.items()}
        redundancy = 2 * len(anchors) - self._views.dimensions
        if redundancy > 0:
            strain = self._motion.strain(after, anchors)
            if strain > chdtri(redundancy, GATE_P):
                for doubtful in self._strained:
                    self._places.pop(doubtful, None)
                self._places.pop(pulse, None)
                return (
                    None,
                    0,
                    phrase(
                        "hand_different_things",
                        "{cameras} follow different things by now (chi-squared {square:.0f})",
                        cameras=", ".join(anchors),
                        square=strain,
                    ),
                )
            self._strained = [*self._strained, pulse] if strain > chdtri(redundancy, _STRAINED_P) else []
        return after, len(chosen) + len(marks), one_after_another([*missing, reason] if reason.text else missing)

    def _candidates(
        self, belief: Belief, pulse: int, names: Sequence[str]
    ) -> tuple[dict[str, list[Candidate]], list[Phrase]]:
        """Where cameras may see the thing, and why others do not."""
        pictures = self._pictures(pulse)
        measured = self._automatic(pulse) if self._automatic else {}
        found: dict[str, list[Candidate]] = {}
        missing: list[Phrase] = []
        for name in names:
            if name not in pictures:
                missing.append(phrase("hand_frame_lacks", "{camera} has no frame", camera=name))
                continue
            candidates: list[Candidate] = []
            if name in measured:
                seen = self._motion.seen(belief, name, with_offset=False)
                candidates = of_automatic(measured[name], seen, pictures[name].shift)
            anchor = self._anchors.get(name)
            if not candidates and anchor is not None:
                seen = self._motion.seen(belief, name, with_offset=True)
                candidates, why = of_images(anchor, pictures[name], seen, name)
                if not candidates:
                    missing.append(why)
            if candidates:
                found[name] = candidates
        return found, missing
