"""Follows skis through the pulses, both together as bars in space, and the bindings that stand on them.

A binding without a marker looks like the rest of its ski: by its appearance alone it slips along it. Where the ski is
seen, tail and tip say where its binding is, which was marked at the start.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.digitizing.following.points.motion import KnownMotion
from analysis.digitizing.following.points.tracks import FAR
from analysis.digitizing.following.pursuit import Found, Pursuit
from analysis.digitizing.following.skis.ski_motion import PairBelief, PairMotion
from analysis.digitizing.following.skis.ski_starts import BINDINGS, SkiStart, ski_start, ski_views
from analysis.digitizing.marks.effective import sigma_of
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.opened_log import OpenedLog
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from analysis.ski_bars.bars import ExpectedBars
from analysis.ski_bars.fitting import FittedBars, fit_bars
from analysis.ski_bars.image_lines import ImageLine
from rig.api.digitizing import MarkSource, MarkState
from rig.arrays import Floats
from rig.errors import BadInputError, NoFitError
from rig.phrase import NOTHING, Phrase, phrase

#: Probability of a sound pulse to contradict the motion before.
_RISK: Final = 1e-4
#: So many pulses in a row a ski may be missed before it has ended.
_MISSED: Final = 3
#: The shape of a ski does not change, but what hides its ends does, m.
_SHAPE_M: Final = 0.003
_REFINED: Final = phrase("hand_refined", "it was refined")
_ORIENT: Final = phrase("hand_skis_in_space", "skis are followed in space: orient the cameras first")


def refine_skis(pursuit: Pursuit, lines: Sequence[str], found: Found) -> None:
    """Find marked skis more exactly at the pulse of an order; what is found takes the place of the marks.

    Args:
        pursuit: with oriented cameras.
        lines: names of the skis.
        found: takes what is found, and why a ski is refused.

    Raises:
        BadInputError: the cameras are not oriented.
        NoFitError: no camera has a frame.
    """
    if (system := pursuit.system) is None:
        raise BadInputError(_ORIENT)
    log, marks, pulse = pursuit.log, pursuit.here, pursuit.order.pulse
    start = ski_start(log, system, marks, pulse, {})
    pursuit.step()
    fitted = _fitted(log, system, pulse, start, start.expected, start.present)
    for k, line in enumerate(BINDINGS):
        if line not in lines:
            continue
        found.stopped[line] = _REFINED if fitted.seen[k] else start.refused.get(line, _unseen(fitted, k, pulse))
        for camera, of in fitted.lines.items():
            if (seen := of[k]) is not None:
                marked = any(key.camera == camera and key.thing == line for key in marks)
                _put(found, pulse, camera, line, seen, MarkSource.REFINED if marked else MarkSource.TRACKED)


def follow_skis(pursuit: Pursuit, lines: Sequence[str], found: Found, known: Mapping[str, KnownMotion]) -> None:
    """Follow skis from a pulse at which they are marked.

    Args:
        pursuit: of the log and its marks.
        lines: names of the skis; those that are not marked there are left out.
        found: takes what is found, of the skis and of bindings that are asked for.
        known: of the motion of points that were followed before, by name.
    """
    here, pulse = pursuit.here, pursuit.order.pulse
    lines = [line for line in lines if any(key.thing == line for key in here)]
    if not lines:
        return
    system = pursuit.system
    if system is None:
        found.stopped.update(dict.fromkeys(lines, _ORIENT))
        return
    start = ski_start(pursuit.log, system, here, pulse, known)
    asked = tuple(line in lines for line in BINDINGS)
    for line, reason in start.refused.items():
        if line in lines:
            found.stopped[line] = reason
    try:
        run = _Run(pursuit, system, start)
    except NoFitError as error:
        found.stopped.update(dict.fromkeys(lines, error.said))
        return
    run.follow(found, (asked[0], asked[1]))


@dataclass(frozen=True, slots=True, eq=False)
class _Anchor:
    """Where an image showed a binding that was marked by hand, against where its ski alone has it.

    Attributes:
        along, across: px.
        covariance: (2, 2) px^2 of that.
        px_per_m: how large 1 m was there.
    """

    along: float
    across: float
    covariance: Floats
    px_per_m: float

    def at(self, seen: ImageLine, px_per_m: float) -> tuple[Floats, Floats]:
        """The binding on the ski as it is seen now, (2,) px, and its covariance (2, 2) px^2."""
        axes, scale = _axes(seen), px_per_m / self.px_per_m
        place = seen.binding + scale * np.array((self.along, self.across)) @ axes
        return place, seen.binding_covariance + self.covariance


def _axes(seen: ImageLine) -> Floats:
    """Unit vectors (2, 2) along a line in an image and across it, in rows."""
    along = (seen.xy[1] - seen.xy[0]) / np.hypot(*(seen.xy[1] - seen.xy[0]))
    return np.array((along, (-along[1], along[0])))


def _anchors(system: CameraSystem, marks: Mapping[Key, Entered], first: FittedBars) -> dict[tuple[str, str], _Anchor]:
    """By binding and camera, those whose ski the camera shows."""
    anchors = {}
    for key, entered in marks.items():
        if key.thing not in BINDINGS.values() or entered.xy is None or entered.state is not MarkState.MEASURED:
            continue
        k = list(BINDINGS.values()).index(key.thing)
        seen = first.lines[key.camera][k] if key.camera in first.lines else None
        if seen is not None:
            along, across = _axes(seen) @ (np.array(entered.xy) - seen.binding)
            covariance = seen.binding_covariance + np.diag(np.square(sigma_of(entered)))
            scale = _px_per_m(system[key.camera], first.poses.point[k])
            anchors[key.thing, key.camera] = _Anchor(float(along), float(across), covariance, scale)
    return anchors


def _px_per_m(camera: PlacedCamera, place: Floats) -> float:
    return float(camera.camera.interior[0] / np.linalg.norm(place - camera.position))


class _Run:
    """The following of a pair of skis."""

    def __init__(self, pursuit: Pursuit, system: CameraSystem, start: SkiStart) -> None:
        self._log, self._system, self._start, self._order = pursuit.log, system, start, pursuit.order
        self._step = pursuit.step
        self._motion = PairMotion(1 / self._log.facts.rate_hz)
        first = _fitted(self._log, system, self._order.pulse, start, start.expected, start.present)
        self._first = first
        self._anchors = _anchors(system, pursuit.here, first)
        self._open = first.seen
        self._shape, self._shape_sigma = first.shape, np.maximum(first.shape_sigma, _SHAPE_M)
        self._missed: list[list[Phrase]] = [[] for _ in BINDINGS]
        self._slipped = [False for _ in BINDINGS]
        self._belief = self._motion.begun(first.poses, first.covariance, start.known)

    def follow(self, found: Found, asked: tuple[bool, bool]) -> None:
        """Through the pulses, as far as the images show the skis."""
        order, pulse = self._order, self._order.pulse
        for k, line in enumerate(BINDINGS):
            if asked[k] and not self._open[k]:
                found.stopped.setdefault(line, _unseen(self._first, k, pulse))
        for _ in range(order.most):
            pulse += order.direction
            self._step()
            if not any(self._open):
                break
            self._belief = self._motion.predicted(self._belief, order.direction)
            fitted, reason = self._at(pulse)
            for k in np.flatnonzero(self._open).tolist():
                if fitted is None or not fitted.seen[k]:
                    self._miss(found, pulse, k, reason if reason.text else _unseen(fitted, k, pulse))
                else:
                    self._keep(found, pulse, k, fitted, asked[k])
        for k, line in enumerate(BINDINGS):
            if asked[k]:
                found.stopped.setdefault(line, self._missed[k][-1] if self._missed[k] else FAR)

    def _miss(self, found: Found, pulse: int, k: int, reason: Phrase) -> None:
        """A ski is not seen; after some such pulses it has ended."""
        line = list(BINDINGS)[k]
        self._missed[k].append(reason)
        if self._slipped[k]:
            _forget(found, pulse, BINDINGS[line])
        if len(self._missed[k]) > _MISSED:
            self._open = (self._open[0] and k != 0, self._open[1] and k != 1)

    def _at(self, pulse: int) -> tuple[FittedBars | None, Phrase]:
        """The skis at a pulse; None with the reason if there is nothing, or if it contradicts the motion."""
        belief = self._belief
        if pulse not in self._log.times:
            return None, phrase("hand_log_ends", "pulse {pulse}: the log ends", pulse=pulse)
        expected = ExpectedBars(belief.poses, belief.pose_covariance, self._shape, self._shape_sigma)
        try:
            fitted = _fitted(self._log, self._system, pulse, self._start, expected, self._first.seen, belief)
        except NoFitError as error:
            return None, error.said
        if not any(fitted.seen):
            return fitted, NOTHING
        if fitted.distance > chdtri(5 * sum(fitted.seen), _RISK):
            return None, phrase(
                "hand_skis_contradict",
                "pulse {pulse}: the skis contradict their motion (chi-squared {square:.0f})",
                pulse=pulse,
                square=fitted.distance,
            )
        self._belief = self._motion.updated(belief, fitted.poses, fitted.covariance)
        return fitted, NOTHING

    def _keep(self, found: Found, pulse: int, k: int, fitted: FittedBars, asked: bool) -> None:
        """Take a ski that is seen, and its binding.

        Of two skis that cover each other, the end of one may be taken for that of the other: where only one of them is
        seen well, its ends do not tell where the binding is.
        """
        self._missed[k].clear()
        line = list(BINDINGS)[k]
        if asked:
            for camera, of in fitted.lines.items():
                if (seen := of[k]) is not None:
                    _put(found, pulse, camera, line, seen, MarkSource.TRACKED)
        binding = BINDINGS[line]
        if binding in found.stopped and self._start.bound[k]:
            shown = self._keep_binding(found, pulse, k, binding, fitted) if fitted.seen == self._first.seen else set()
            if self._slipped[k]:
                _forget(found, pulse, binding, shown)

    def _keep_binding(self, found: Found, pulse: int, k: int, name: str, fitted: FittedBars) -> set[str]:
        """Put a binding where its ski has it; the cameras in which that was possible."""
        shown = set()
        for camera, of in fitted.lines.items():
            seen, anchor, key = of[k], self._anchors.get((name, camera)), Key(pulse, camera, name)
            known = found.marks.get(key)
            if seen is None or anchor is None:
                continue
            place, spread = anchor.at(seen, _px_per_m(self._system[camera], fitted.poses.point[k]))
            if known is not None and known.xy is not None and known.sigma is not None:
                off = np.array(known.xy) - place
                both = spread + np.diag(np.square(known.sigma))
                if off @ np.linalg.solve(both, off) > chdtri(2, _RISK):
                    self._slipped[k] = True  # its appearance was followed to another place
            found.add(key, place, np.sqrt(np.diagonal(spread)))
            shown.add(camera)
        return shown


def _fitted(
    log: OpenedLog, system: CameraSystem, pulse: int, start: SkiStart,
    expected: ExpectedBars, present: tuple[bool, bool], belief: PairBelief | None = None,
) -> FittedBars:  # fmt: skip
    rate = log.facts.rate_hz
    velocity = start.known[0].velocity if belief is None else belief.velocity.mean(axis=0) * rate
    return fit_bars(ski_views(log, system, pulse, velocity), expected, present, drawn=True)


def _put(found: Found, pulse: int, camera: str, line: str, seen: ImageLine, source: MarkSource) -> None:
    for vertex, place in enumerate(seen.xy):
        found.add(Key(pulse, camera, line, vertex), place, np.array((seen.sigma, seen.sigma)), source)


def _unseen(fitted: FittedBars | None, k: int, pulse: int) -> Phrase:
    shown = [] if fitted is None else [camera for camera, of in fitted.lines.items() if of[k] is not None]
    if not shown:
        return phrase("hand_ski_unseen", "pulse {pulse}: two images must show the ski well; none does", pulse=pulse)
    return phrase(
        "hand_ski_little_seen",
        "pulse {pulse}: two images must show the ski well; {cameras} does",
        pulse=pulse,
        cameras=", ".join(shown),
    )


def _forget(found: Found, pulse: int, name: str, but: Collection[str] = ()) -> None:
    """Leave out a binding that was followed by its appearance after that had slipped, but in some cameras."""
    for key in [key for key in found.marks if key.pulse == pulse and key.thing == name and key.camera not in but]:
        del found.marks[key]
