"""Why the calibration helper refuses something."""

from typing import Final

from rig.phrase import phrase

COMPUTING: Final = phrase(
    "calibrating_computing",
    "a calibration is being computed: wait until it is done, then take pictures away",
)
NO_PICTURE: Final = phrase(
    "calibrating_no_picture",
    "there is no picture to take away: hold the target still before the cameras",
)
NO_PICTURES: Final = phrase(
    "calibrating_no_pictures",
    "there are no pictures to compute from: hold the target before the cameras first",
)
NO_CALIBRATION: Final = phrase(
    "calibrating_none",
    "there is no calibration yet: compute it, then put it into the rig file",
)
NO_PROTOCOL: Final = phrase(
    "calibrating_no_protocol",
    "there is no protocol yet: compute the calibration first",
)
IN_USE: Final = phrase(
    "calibrating_in_use",
    "the calibration by these pictures is in the rig file: begin anew for another one",
)
