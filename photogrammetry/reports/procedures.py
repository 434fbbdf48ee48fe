"""Reports and result files of the paper's procedures: calibration and orientation."""

import math
from dataclasses import replace
from typing import Any

from photogrammetry.adjustment.run import Outcome
from photogrammetry.procedures.calibration import Calibration
from photogrammetry.procedures.findings import PointTest, Stage
from photogrammetry.procedures.orientation import Orientation
from photogrammetry.reports.adjusted import NOTHING, Wishes, adjusted_sections
from photogrammetry.reports.document import Report, Section, Table
from photogrammetry.reports.result_file import outcome_to_json
from photogrammetry.reports.summary import summarise


def calibration_to_json(calibration: Calibration) -> dict[str, Any]:
    """The free adjustment's result; `svev orient --calibration` takes its cameras."""
    return outcome_to_json(calibration.outcome) | {"notes": list(calibration.notes)}


def calibration_lines(calibration: Calibration) -> list[str]:
    """Lines for the screen."""
    return [*summarise(calibration.outcome), *calibration.notes]


def calibration_report(calibration: Calibration, wishes: Wishes = NOTHING) -> Report:
    """The whole report of a calibration, with the further tables that were asked for."""
    notes = calibration.notes or ("All parameters are significant, and none is hard to tell from another.",)
    procedure = "Free adjustment of a 3D frame of unknown targets with self-calibration; inner constraints."
    sections = (Section("Procedure", (procedure, *notes)), *adjusted_sections(calibration.outcome, wishes))
    return Report("Calibration of the cameras", sections)


def orientation_to_json(orientation: Orientation) -> dict[str, Any]:
    """The constrained adjustment's result with the findings of the three stages."""
    stages = [
        {
            "stage": stage.name.value,
            "words": stage.words,
            "findings": [{"message": finding.message, "removed": finding.removed} for finding in stage.findings],
            "tests": [_test_to_json(test) for test in stage.tests],
        }
        for stage in orientation.stages
    ]
    return outcome_to_json(orientation.outcome) | {"stages": stages, "notes": list(orientation.notes)}


def _test_to_json(test: PointTest) -> dict[str, Any]:
    return {"point": test.point, "v": test.v, "r": test.r, "w": [w if math.isfinite(w) else None for w in test.w]}


def orientation_lines(orientation: Orientation) -> list[str]:
    """Lines for the screen: the stages and the constrained adjustment."""
    lines = list(orientation.notes)
    for number, stage in enumerate(orientation.stages, start=1):
        lines += [f"stage {number}, {stage.name.value}: {stage.words}", *(f"  {line}" for line in _findings(stage))]
    return [*lines, *summarise(_final(orientation))]


def orientation_report(orientation: Orientation, wishes: Wishes = NOTHING) -> Report:
    """The whole report of a pose estimation, stage by stage, with the further tables that were asked for."""
    stages = [
        Section(f"Stage {number}: {stage.name.value}", (stage.words, *_findings(stage), *_tests(stage)))
        for number, stage in enumerate(orientation.stages, start=1)
    ]
    adjusted = adjusted_sections(orientation.outcome, wishes)
    sections = (Section("Procedure", orientation.notes), *stages, *adjusted)
    return Report("Pose estimation", sections)


def _final(orientation: Orientation) -> Outcome:
    """The constrained adjustment without the removed observations, which the stages have named already."""
    return replace(orientation.outcome, removed=())


def _tests(stage: Stage) -> tuple[Table, ...]:
    """Residuals, redundancy numbers and test values of the reference points in the similarity transformation."""
    rows = tuple(
        (
            test.point,
            *(f"{v:.4f}" for v in test.v),
            *(f"{r:.2f}" for r in test.r),
            *(f"{w:.1f}" if math.isfinite(w) else "-" for w in test.w),
        )
        for test in stage.tests
    )
    return (Table(("point", "vX", "vY", "vZ", "rX", "rY", "rZ", "wX", "wY", "wZ"), rows),) if rows else ()


def _findings(stage: Stage) -> list[str]:
    if not stage.findings:
        return [] if stage.words.startswith("left out") else ["no gross error found"]
    return [f"{'taken out' if finding.removed else 'suspected'}: {finding.message}" for finding in stage.findings]
