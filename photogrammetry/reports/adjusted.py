"""Sections of a report that every adjustment has: parameters with sigma, correlations, residuals, findings."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from photogrammetry.adjustment.gross_errors.blunders import in_file_frame
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import GLOBAL_RISK, GlobalTest
from photogrammetry.adjustment.solution.reliability import reliability
from photogrammetry.adjustment.solution.statistics import correlation
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import AXES
from photogrammetry.reports.document import Section, Table
from photogrammetry.reports.drawing.network import network_drawings
from photogrammetry.reports.drawing.residuals import residual_drawings
from photogrammetry.reports.record.assumptions import assumptions
from photogrammetry.reports.record.observed import image_parts, measured_parts, reliability_parts, survey_parts
from photogrammetry.reports.record.orientations import interior_parts, mean_parts, point_parts, pose_parts
from photogrammetry.reports.record.strength import coverage_parts
from photogrammetry.reports.result_extras import joint_covariance
from photogrammetry.reports.summary import summarise

_CORRELATION_LISTED = 0.9  # larger correlations are listed
_SHOWN = 20  # listed correlations, at most
_POSE = ("X0", "Y0", "Z0", "angle 1", "angle 2", "angle 3")


@dataclass(frozen=True, slots=True)
class Wishes:
    """What a report has on request.

    Attributes:
        detectable: the minimal detectable blunder of each observation, and what it would do.
        covariance: names of points (`*` and `?`) whose joint covariance it shows.
    """

    detectable: bool = False
    covariance: Sequence[str] = ()


NOTHING = Wishes()


def adjusted_sections(outcome: Outcome, wishes: Wishes = NOTHING) -> tuple[Section, ...]:
    """The common sections of an adjusted network.

    Args:
        outcome: the adjusted network.
        wishes: what was asked for beside.

    Raises:
        BadInputError: the joint covariance of points that do not exist is asked for.
    """
    a = outcome.adjustment
    found = reliability(a)
    of_images, of_relations = (found.image, found.relation) if wishes.detectable else (None, None)
    observed = (
        *_residuals(a),
        *survey_parts(outcome, of_relations),
        *measured_parts(a, of_relations),
        *image_parts(outcome, of_images),
    )
    sections = [
        Section("Summary", tuple(summarise(outcome))),
        Section("Assumed a priori", assumptions(a)),
        Section("Global test", _global_test(a)),
        Section("Network", network_drawings(a)),
        Section("Interior orientation", interior_parts(outcome)),
        Section("Poses", pose_parts(a)),
        Section("Points", (*point_parts(a), *mean_parts(a))),
        Section("Image coverage", coverage_parts(a)),
        Section("Correlations", _correlations(a)),
        Section("Joint covariance", _joint(a, wishes.covariance)),
        Section("Reliability", reliability_parts(a, found)),
        Section("Residuals", (*residual_drawings(a), *observed)),
    ]
    return tuple(section for section in sections if section.parts)


def _global_test(a: Adjustment) -> tuple[str | Table, ...]:
    test = GlobalTest(a.ratio, a.redundancy)
    if a.sigma0 is None:
        return (test.words,)
    low, high = test.limits
    cells = (
        f"{a.sigma0:.4g}",
        f"{a.network.sigma0:g}",
        f"{a.ratio:.4g}",
        str(a.redundancy),
        f"{low:.3f} to {high:.3f}",
    )
    head = ("sigma0", "a priori", "ratio", "redundancy", f"accepted at {GLOBAL_RISK:.0%}", "chance")
    return (f"{test.verdict.value}: {test.words}", Table(head, ((*cells, f"{test.chance:.3g}"),)))


def _joint(a: Adjustment, patterns: Sequence[str]) -> tuple[str | Table, ...]:
    """Covariances of all pairs of the points asked for, in one row each."""
    if not patterns:
        return ()
    joint = joint_covariance(a, patterns)
    names, matrix = joint["points"], np.array(joint["covariance"])
    rows = tuple(
        (names[i], names[k], *(f"{x:.3e}" for x in matrix[3 * i : 3 * i + 3, 3 * k : 3 * k + 3].ravel()))
        for i in range(len(names))
        for k in range(i, len(names))
    )
    head = ("one", "other", *(f"{x}{y}" for x in AXES for y in AXES))
    return (
        f"A posteriori, ({a.length_unit or 'length units'})²; first axis of one, second of the other:",
        Table(head, rows),
    )


def _correlations(a: Adjustment) -> tuple[str | Table, ...]:
    """Strong correlations among interior orientation and pose of each image."""
    found = {}
    for image, columns in enumerate(a.problem.global_columns()):
        names = _names(a, image)
        known = columns >= 0
        matrix = correlation(a.covariance(columns[known]))
        chosen = [name for name, there in zip(names, known, strict=True) if there]
        for (i, one), (j, other) in combinations(enumerate(chosen), 2):
            if abs(matrix[i, j]) >= _CORRELATION_LISTED:
                found[one, other] = float(matrix[i, j])
    if not found:
        return (f"None of interior orientation and poses reaches {_CORRELATION_LISTED:g}.",)
    strongest = sorted(found.items(), key=lambda item: -abs(item[1]))
    rows = tuple((one, other, f"{value:.3f}") for (one, other), value in strongest[:_SHOWN])
    words = f"{len(found)} among interior orientation and pose reach {_CORRELATION_LISTED:g}"
    return (f"{words}; the strongest:" if len(found) > _SHOWN else f"{words}:", Table(("one", "other", "r"), rows))


def _names(a: Adjustment, image: int) -> list[str]:
    camera = a.network.cameras[a.network.images[image].camera].name
    interior = [f"{camera} {INTERIOR[i]}" for i in a.problem.unknowns.selection]
    return [*interior, *(f"{a.network.images[image].name} {name}" for name in _POSE)]


def _residuals(a: Adjustment) -> tuple[str | Table, ...]:
    """Residuals in the mean of each image."""
    v = in_file_frame(a.network, a.image_residuals())
    w = np.nan_to_num(np.abs(a.image_w()))
    r = a.controlled.image_numbers
    rows = []
    for i, image in enumerate(a.network.images):
        rows_of = slice(a.problem.start[i], a.problem.start[i + 1])
        if len(v[rows_of]):
            root = np.sqrt(np.mean(v[rows_of] ** 2, axis=0))
            worst = f"{w[rows_of].max():.1f}"
            rows.append(
                (
                    image.name,
                    str(len(v[rows_of])),
                    f"{root[0]:.3g}",
                    f"{root[1]:.3g}",
                    f"{r[rows_of].mean():.2f}",
                    worst,
                )
            )
    head = ("image", "points", "rms vx", "rms vy", "mean r", "largest |w|")
    return (f"Images ({a.network.image_unit}):", Table(head, tuple(rows))) if rows else ()
