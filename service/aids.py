"""Pictures and figures of single cameras, from the triplets that the recorder leaves for people to look at."""

from analysis.images.aids import Image, exposure, focus, sharp
from rig.api.cameras.aids import BINS, CameraAids
from rig.frame import FrameStatus
from rig.images.picture import shown
from rig.images.pixels import MONO8, Pixels
from rig.settings.model import RigSettings
from rig.transport.preview import PreviewImage
from service.seam.cameras import CloseUp


def shown_as(rig: RigSettings) -> Pixels:
    """What the pixels of such a triplet are: the recorder has made eight bits of deeper ones."""
    return rig.pixels if rig.pixels.is_mosaic else MONO8


def aids_of(image: PreviewImage, rig: RigSettings, camera: int) -> CameraAids:
    """How sharp and how bright the picture of a camera is.

    Args:
        image: the triplet.
        rig: the rig.
        camera: index of the camera.
    """
    name, status = rig.cameras[camera].name, image.statuses[camera]
    if status is not FrameStatus.OK:
        return CameraAids(camera=name, pulse=image.pulse, status=status)
    pixels = frame_of(image.pixels, rig, camera)
    light = exposure(pixels, BINS)
    return CameraAids(
        camera=name,
        pulse=image.pulse,
        status=status,
        focus=round(100 * focus(pixels, mosaic=rig.pixels.is_mosaic), 4),
        mean=round(100 * light.mean, 2),
        clipped=round(100 * light.clipped, 4),
        black=round(100 * light.black, 4),
        histogram=light.histogram,
    )


def close_up_of(image: PreviewImage, rig: RigSettings, camera: int, *, peaking: bool) -> CloseUp:
    """The whole picture of a camera.

    Args:
        image: the triplet.
        rig: the rig.
        camera: index of the camera.
        peaking: whether to look where it is in focus.
    """
    pixels, status = frame_of(image.pixels, rig, camera), image.statuses[camera]
    marked = sharp(pixels, mosaic=rig.pixels.is_mosaic) if peaking and status is FrameStatus.OK else None
    return CloseUp(image.pulse, status, shown(pixels, shown_as(rig), coloured=True), marked)


def frame_of(triplet: Image, rig: RigSettings, camera: int) -> Image:
    """The frame of a camera in a triplet."""
    left, right = rig.columns()[camera]
    return triplet[: rig.cameras[camera].region.height, left:right]
