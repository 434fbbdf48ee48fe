"""The protocol of a calibration, and its result file."""

from typing import Any

from photogrammetry.adjustment.result_file import outcome_to_json
from photogrammetry.adjustment.summary import summarise
from photogrammetry.procedures.calibration import Calibration
from photogrammetry.protocol.adjusted import adjusted_sections
from photogrammetry.protocol.document import Protocol, Section


def calibration_to_json(calibration: Calibration) -> dict[str, Any]:
    """The free adjustment's result; `svev orient --calibration` takes its cameras."""
    return outcome_to_json(calibration.outcome) | {"notes": list(calibration.notes)}


def calibration_lines(calibration: Calibration) -> list[str]:
    """What a screen shows."""
    return [*summarise(calibration.outcome), *calibration.notes]


def calibration_protocol(calibration: Calibration) -> Protocol:
    """The protocol."""
    notes = calibration.notes or ("All parameters are significant, and none is hard to tell from another.",)
    procedure = "Free adjustment of a 3D frame of unknown targets with self-calibration; inner constraints."
    sections = (Section("Procedure", (procedure, *notes)), *adjusted_sections(calibration.outcome))
    return Protocol("Calibration of the cameras", sections)
