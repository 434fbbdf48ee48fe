"""Which errors of the calibration recordings have in common: they cancel in differences.

Recordings with one calibration share all of them. Recordings that were oriented one by one with the same survey and
interior orientation share the errors of these, not those of the balls' images. Others share nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.result.model import MeasuredRecording
from rig.arrays import Floats


class Common(StrEnum):
    """What recordings have in common."""

    CALIBRATION = "calibration"
    SURVEY = "survey"
    NOTHING = "nothing"


@dataclass(frozen=True, slots=True, eq=False)
class SharedCalibration:
    """Covariances of the cameras' parameters.

    Attributes:
        common: what the recordings have in common.
        shared: (p, p) of the errors that all have; None if there are none.
        own: by recording, (p, p) of the errors that it alone has.
    """

    common: Common
    shared: Floats | None
    own: tuple[Floats, ...]


def shared_calibration(recordings: Sequence[MeasuredRecording]) -> SharedCalibration:
    """What recordings share."""
    found = [recording.orientation for recording in recordings]
    first = found[0]
    if all(each.source == first.source for each in found):
        return SharedCalibration(
            Common.CALIBRATION, first.covariance, tuple(np.zeros_like(each.covariance) for each in found)
        )
    given = [each.given_covariance for each in found]
    known = [matrix for matrix in given if matrix is not None]
    same = first.given and all((e.given, e.parameters) == (first.given, first.parameters) for e in found)
    if not same or len(known) < len(found):
        return SharedCalibration(Common.NOTHING, None, tuple(each.covariance for each in found))
    return SharedCalibration(
        Common.SURVEY,
        np.asarray(np.mean(known, axis=0)),
        tuple(each.covariance - part for each, part in zip(found, known, strict=True)),
    )
