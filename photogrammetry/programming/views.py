"""Images whose pose and interior orientation are known: from object points to image points, and back to rays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.geometry.camera_model import image_point, undistort
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.file_writer import metric_to_pixel
from photogrammetry.network.model import Camera, ImageFrame, Network
from photogrammetry.programming.results import Result
from rig.arrays import Floats
from rig.errors import BadInputError


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """An oriented image; image points are in the network's frame (pixel or metric).

    Attributes:
        camera: its interior orientation.
        X0: (3,) projection centre.
        R: (3, 3), its columns are the camera's axes.
        frame: of the image points.
    """

    camera: Camera
    X0: Floats
    R: Floats
    frame: ImageFrame

    @property
    def ideal(self) -> IdealCamera:
        """The camera without distortion, which takes `reduced` image points."""
        return IdealCamera(float(self.camera.interior[0]), self.X0, self.R)

    def project(self, xyz: ArrayLike) -> Floats:
        """Image points (..., 2) of object points (..., 3), with distortion."""
        xy = image_point(self.camera.lens(), self.R, self.X0, np.asarray(xyz, float))
        return metric_to_pixel(np.asarray(xy), self._size()) if self.frame is ImageFrame.PIXEL else np.asarray(xy)

    def reduced(self, xy: ArrayLike) -> Floats:
        """Image points (..., 2) without distortion, metric, counted from the principal point."""
        given = np.asarray(xy, float)
        metric = pixel_to_metric(given, self._size()) if self.frame is ImageFrame.PIXEL else given
        return np.asarray(undistort(self.camera.lens(), metric))

    def rays(self, xy: ArrayLike) -> Floats:
        """Unit vectors (..., 3) in the object system from the projection centre to image points (..., 2)."""
        return self.ideal.rays(self.reduced(xy))

    def _size(self) -> Floats:
        if self.camera.size is None:
            raise BadInputError(f'camera {self.camera.name}: "size" is missing; the pixel frame needs [width, height]')
        return np.array(self.camera.size, dtype=float)


def views_of(oriented: Result | Network) -> dict[str, View]:
    """Oriented images by name.

    Args:
        oriented: a result, whose adjusted values are taken, or a network that gives all poses.

    Raises:
        BadInputError: an image of the network has no pose.
    """
    if isinstance(oriented, Result):
        a = oriented.adjustment
        cameras = [_with(camera, values) for camera, values in zip(a.network.cameras, a.state.interior, strict=True)]
        poses = zip(a.network.images, a.state.position, a.state.rotation, strict=True)
        frame = a.network.image_frame
        return {image.name: View(cameras[image.camera], x0, r, frame) for image, x0, r in poses}
    views = {}
    for image in oriented.images:
        if image.position is None or image.rotation is None:
            raise BadInputError(f'image {image.name}: no pose; give "X0" and "R", or orient the network first')
        camera = oriented.cameras[image.camera]
        views[image.name] = View(camera, image.position, image.rotation, oriented.image_frame)
    return views


def _with(camera: Camera, interior: Floats) -> Camera:
    """The camera with adjusted values."""
    return Camera(camera.name, interior, camera.balance, camera.distortion, camera.size)
