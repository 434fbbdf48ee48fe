"""A log that is being measured by hand: its pulses, what became of each frame, and frames one by one."""

import threading
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.cameras.frames import camera_images
from analysis.candidates.foreground.background import Background
from analysis.measurements.model import Measurements
from analysis.procedure.log_facts import log_facts
from analysis.scene.static_image import StaticImage, static_images
from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import stored_pulses
from rig.clocks import UtcNs
from rig.errors import UnknownCameraError, UnknownRecordingError
from rig.frame import FrameStatus
from rig.images.picture import Grey, measurable, shown
from rig.phrase import Phrase, phrase
from rig.tag import CameraTag

LETTERS: Final = {
    FrameStatus.OK: "o",
    FrameStatus.LOST: "l",
    FrameStatus.MISSED: "m",
    FrameStatus.DAMAGED: "d",
    FrameStatus.ABSENT: "a",
}
_FATES: Final = {
    FrameStatus.OK: phrase("hand_frame_unreadable", "damaged in the file"),
    FrameStatus.LOST: phrase("hand_frame_lost", "lost"),
    FrameStatus.MISSED: phrase("hand_frame_missed", "missed"),
    FrameStatus.DAMAGED: phrase("hand_frame_damaged", "damaged"),
    FrameStatus.ABSENT: phrase("hand_frame_absent", "absent"),
}
#: So many pulses stay in memory: those around the one that is looked at.
_KEPT: Final = 12
#: A difference of so many standard deviations of a pixel's noise is shown black or white.
_SHOWN_SIGMAS: Final = 12.0
_GREY: Final = 128


class NoFrameError(UnknownRecordingError):
    """The log has no such frame; the message says what became of it."""


class OpenedLog:
    """Any thread may call any method.

    Args:
        log: the log.

    Raises:
        BadInputError: no such log, or it holds no pulse.
    """

    def __init__(self, log: Path) -> None:
        self.path = log
        self.facts = log_facts(log)
        with RecordingReader(log) as reader:
            stored = {int(tag.pulse): (tag, triplet) for tag, triplet in stored_pulses(reader)}
        found = {pulse: tag for pulse, (tag, _) in stored.items()}
        self.pulses = sorted(found)
        self.times: Mapping[int, UtcNs] = {pulse: found[pulse].time for pulse in self.pulses}
        self.status = {
            camera: "".join(_letter(found[pulse].cameras, camera) for pulse in self.pulses)
            for camera in self.facts.cameras
        }
        self._stored = {pulse: triplet for pulse, (_, triplet) in stored.items() if triplet is not None}
        self._lock = threading.Lock()
        self._frames: OrderedDict[int, tuple[dict[str, Grey], dict[str, NDArray[np.uint8]]]] = OrderedDict()
        self._static: dict[str, StaticImage] | None = None
        self._backgrounds: dict[str, Background] | None = None

    @property
    def unmeasured(self) -> Measurements:
        """The recording with its rate and cameras, and nothing measured."""
        return Measurements(self.facts.recording, self.facts.rate_hz, self.facts.cameras, ())

    def index(self, pulse: int) -> int:
        """The place of a pulse among those of the log.

        Raises:
            UnknownRecordingError: the log has no such pulse.
        """
        at = bisect_left(self.pulses, pulse)
        if at == len(self.pulses) or self.pulses[at] != pulse:
            raise UnknownRecordingError(
                phrase(
                    "hand_no_pulse",
                    "the log has no pulse {pulse}: it goes from {first} to {last}",
                    pulse=pulse,
                    first=self.pulses[0],
                    last=self.pulses[-1],
                )
            )
        return at

    def require_camera(self, name: str) -> None:
        """Refuse a camera that is none of the log.

        Raises:
            UnknownCameraError: the log has no such camera.
        """
        if name not in self.facts.cameras:
            raise UnknownCameraError(
                phrase(
                    "hand_no_camera",
                    "the log has no camera {camera}: choose among {cameras}",
                    camera=name,
                    cameras=", ".join(self.facts.cameras),
                )
            )

    def frames(self, pulse: int) -> Mapping[str, Grey]:
        """The frames of a pulse by camera, grey values to measure in; those that are not there are left out."""
        return self._read(pulse)[0]

    def frame(self, pulse: int, camera: str) -> Grey:
        """The frame of a camera, (rows, columns) grey values to measure in.

        Raises:
            NoFrameError: there is none.
            UnknownRecordingError, UnknownCameraError: the log has no such pulse or camera.
        """
        frames = self._read(pulse)[0]
        if camera not in frames:
            self.require_camera(camera)
            raise NoFrameError(self._why_none(pulse, camera))
        return frames[camera]

    def has(self, pulse: int, camera: str) -> bool:
        """Whether a camera delivered a frame of a pulse of the log."""
        at = bisect_left(self.pulses, pulse)
        return self.status[camera][at] == LETTERS[FrameStatus.OK]

    def png(self, pulse: int, camera: str, *, difference: bool = False) -> bytes:
        """A frame as a PNG file without loss, or its difference from the background.

        Raises:
            NoFrameError: there is none.
            UnknownRecordingError, UnknownCameraError: the log has no such pulse or camera.
        """
        grey, pictures = self._read(pulse)
        if camera not in pictures:
            self.require_camera(camera)
            raise NoFrameError(self._why_none(pulse, camera))
        picture = pictures[camera]
        if difference:
            picture = _difference(grey[camera], self.static()[camera])
        _, png = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        return png.tobytes()

    def static(self) -> dict[str, StaticImage]:
        """What each camera sees when nothing moves; takes a second or two at the first call.

        Raises:
            LogDamagedError: no frame can be read.
        """
        with self._lock:
            if self._static is None:
                self._static = static_images(self.path)
            return self._static

    def backgrounds(self) -> dict[str, Background]:
        """The static scene of each camera, to compare its frames with.

        Raises:
            LogDamagedError: no frame can be read.
        """
        static = self.static()
        with self._lock:
            if self._backgrounds is None:
                self._backgrounds = {name: Background(image) for name, image in static.items()}
            return self._backgrounds

    def _read(self, pulse: int) -> tuple[dict[str, Grey], dict[str, NDArray[np.uint8]]]:
        with self._lock:
            if pulse in self._frames:
                self._frames.move_to_end(pulse)
                return self._frames[pulse]
            found: tuple[dict[str, Grey], dict[str, NDArray[np.uint8]]] = ({}, {})
            if (triplet := self._stored.get(pulse)) is not None:
                with RecordingReader(self.path) as reader:
                    try:
                        image = triplet.image(reader)
                        grey, picture = measurable(image, triplet.tag.pixels), shown(image, triplet.tag.pixels)
                        found = (
                            {name: part.copy() for name, part in camera_images(triplet.tag, grey).items()},
                            {name: part.copy() for name, part in camera_images(triplet.tag, picture).items()},
                        )
                    except ValueError:
                        found = ({}, {})  # a damaged chunk: `svev verify` names it, and the page shows that it is none
            self._frames[pulse] = found
            while len(self._frames) > _KEPT:
                self._frames.popitem(last=False)
            return found

    def _why_none(self, pulse: int, camera: str) -> Phrase:
        letter = self.status[camera][self.index(pulse)]
        fate = next(status for status, known in LETTERS.items() if known == letter)
        return phrase(
            "hand_no_frame",
            "the frame of {camera} at pulse {pulse} is {fate}: measure in another pulse",
            camera=camera,
            pulse=pulse,
            fate=_FATES[fate],
        )


def _letter(cameras: tuple[CameraTag, ...], name: str) -> str:
    return next((LETTERS[tag.status] for tag in cameras if tag.name == name), LETTERS[FrameStatus.ABSENT])


def _difference(grey: Grey, static: StaticImage) -> NDArray[np.uint8]:
    """Grey value minus background over noise, middle grey where nothing differs."""
    sigmas = (grey.astype(np.float32) - static.grey) / np.maximum(static.noise, 1e-3)
    return np.clip(_GREY + sigmas * (_GREY / _SHOWN_SIGMAS), 0, 255).astype(np.uint8)
