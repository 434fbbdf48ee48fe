"""What helps to set up a camera, as the REST API tells it: how sharp its picture is, and how well exposed."""

from pydantic import Field

from rig.api.fields import Model
from rig.frame import FrameStatus

#: Of the histogram, from black to white, each of four grey levels of eight bits.
BINS = 64


class CameraAids(Model):
    """Figures of one frame of a camera; those of its picture are null if the frame did not come."""

    camera: str
    pulse: int = Field(description="since the recorder was started")
    status: FrameStatus = Field(description="what became of the frame")
    focus: float | None = Field(
        None,
        description="root mean square of the brightness gradient, percent of the mean brightness per pixel: the "
        "larger, the sharper; to be compared only with itself while nobody changes what the camera sees",
    )
    mean: float | None = Field(None, description="mean brightness, percent of white")
    clipped: float | None = Field(None, description="share of the pixels that are white, percent")
    black: float | None = Field(None, description="share of the pixels that are black, percent")
    histogram: tuple[int, ...] = Field((), description="number of pixels in 64 equal steps from black to white")
