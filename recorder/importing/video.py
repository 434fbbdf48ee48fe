"""A video of a camera, decoded frame by frame, each with the number that its time gives it."""

import re
from array import array
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import av
import numpy as np
from av import VideoFrame
from av.container import InputContainer
from av.error import FFmpegError
from av.video.stream import VideoStream

from recorder.importing.frame_times import frame_numbers
from recorder.importing.grey import bits_of, grey_of
from recorder.importing.source import Taken
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.host.files import open_to_read

#: A video whose own rate is so much another than the one that is given, as a share, was slowed down or sped up.
_OTHER_RATE: Final = 0.01
#: Playlists, which FFmpeg takes for videos, lead to other files and to the network: nothing but this file is read.
_OWN_FILE_ONLY: Final = {"protocol_whitelist": "pipe"}


class Video:
    """The first video stream of a file. Its frames count from 1; where their times have a gap, frames were lost.

    Args:
        path: the file.
        rate_hz: frames per second when it was taken.

    Raises:
        BadInputError: it is no video, or its first frame cannot be decoded.
    """

    def __init__(self, path: Path, rate_hz: float) -> None:
        self.path, self._rate_hz = path, rate_hz
        self.first = 1
        self._ticks, self._numbers = array("q"), array("q")  # of the frames that were read; units of `_tick_s`
        self._untimed = self._frames = self._last = 0
        self._broken = ""
        with _opened(path) as (container, stream):
            frame = next(_decoded(container, stream), None)
            if frame is None:
                raise BadInputError(f"{path}: no frame of it can be decoded; copy it again, or export it anew")
            self.size = (frame.width, frame.height)
            self.bits = bits_of(frame)
            self._tick_s = float(stream.time_base or 0)
            self.kind = f"video, {stream.codec_context.name}, {frame.format.name}"
            self._declared = stream.frames or None
            self._duration_s = _duration_s(container, stream)
            rate = stream.average_rate
            self.file_rate_hz = None if rate is None else float(rate)
            self.date = _date({**container.metadata, **stream.metadata})
            self._first_remarks = tuple(_remarks(frame))

    @property
    def expected(self) -> int | None:
        """Number of frames that the file says it has; None: it does not say."""
        if self._declared is None and self._duration_s is not None and self.file_rate_hz is not None:
            return round(self._duration_s * self.file_rate_hz)
        return self._declared

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of it; of times and of its end only when all frames have been read."""
        found = [*self._first_remarks]
        if self.file_rate_hz is not None and abs(self.file_rate_hz / self._rate_hz - 1) > _OTHER_RATE:
            found.append(
                f"the file plays {self.file_rate_hz:.6g} frames a second; --rate says that {self._rate_hz:.6g} were"
                " taken"
            )
        if lost := self._last - self._frames:
            found.append(f"frames left out among its times: {lost}; these frames are lost")
        if times := self._times_in_words():
            found.append(times)
        if self._broken:
            found.append(self._broken)
        return tuple(found)

    def frames(self, first: int) -> Iterator[Taken]:
        """Decode the frames, from the frame `first` on.

        Where the video breaks off, the frames end, and `remarks` says so.

        Raises:
            BadInputError: there is no such frame, or frames differ in size or pixels.
        """
        self._ticks, self._numbers, self._broken = array("q"), array("q"), ""
        self._untimed = self._frames = self._last = 0
        if first < 1:
            raise BadInputError(f"{self.path}: has no frame {first}: its frames count from 1; correct --start")
        numbers = self._numbers_by_time()
        with _opened(self.path) as (container, stream):
            frames = _decoded(container, stream)
            while True:
                try:
                    frame = next(frames, None)
                except FFmpegError as error:
                    self._broken = f"breaks off after frame {self._last}: {error.strerror}"
                    break
                if frame is None:
                    self._broken = self._cut_short()
                    break
                before, self._last = self._last, self._number(frame, numbers)
                self._frames += 1
                self._note_time(frame)
                for lost in range(max(before + 1, first), self._last):
                    why = f"{self.path} has no frame {lost}, by the times of those beside it"
                    yield Taken(lost, None, FrameStatus.LOST, why)
                if self._last >= first:
                    yield self._taken(self._last, frame)
        if self._last < first:
            raise BadInputError(f"{self.path}: has no frame {first}: it has {self._last} frames; correct --start")

    def _numbers_by_time(self) -> dict[int, int]:
        """The numbers of the frames by their times in the file; none where times do not tell."""
        with _opened(self.path) as (container, stream):
            try:
                found = {packet.pts for packet in container.demux(stream) if packet.pts is not None}
            except FFmpegError:  # the frames before the damage count one by one, and then it is said
                return {}
        ticks = np.array(sorted(found), np.int64)
        if (told := frame_numbers(ticks)) is None:
            return {}
        numbers, period = told
        if self._tick_s and numbers[-1] > len(numbers):
            self.file_rate_hz = 1.0 / (period * self._tick_s)
        return dict(zip(ticks.tolist(), numbers.tolist(), strict=True))

    def _number(self, frame: VideoFrame, numbers: Mapping[int, int]) -> int:
        """Number of a frame; the first one that is shown is frame 1."""
        number = None if frame.pts is None else numbers.get(frame.pts)
        earlier = numbers.get(self._ticks[0]) if self._ticks else number
        if number is None or earlier is None or (told := number - earlier + 1) <= self._last:
            return self._last + 1
        return told

    def _taken(self, number: int, frame: VideoFrame) -> Taken:
        if frame.is_corrupt:
            return Taken(number, None, FrameStatus.DAMAGED, f"frame {number} of {self.path} is damaged")
        if (frame.width, frame.height) != self.size or bits_of(frame) != self.bits:
            raise BadInputError(
                f"{self.path}: frame {number} is {frame.width} x {frame.height} px of {bits_of(frame)} bits, those "
                f"before it are {self.size[0]} x {self.size[1]} px of {self.bits}: cut it there into two videos"
            )
        return Taken(number, grey_of(frame))

    def _note_time(self, frame: VideoFrame) -> None:
        if frame.pts is None:
            self._untimed += 1
        else:
            self._ticks.append(frame.pts)
            self._numbers.append(self._last)

    def _cut_short(self) -> str:
        """What the file says of frames that are not there, in words; empty: nothing."""
        if self._declared is not None and self._last < self._declared:  # AVI declares those that were dropped, too
            return f"ends after frame {self._last}, and the file speaks of {self._declared}"
        expected = self.expected
        if self._declared is None and expected is not None and self._last < expected - 1:
            return f"ends after frame {self._last}, and by its duration it has {expected}"
        return ""

    def _times_in_words(self) -> str:
        """By how much the times of the frames differ from those of frames that come evenly; empty: by nothing."""
        if self._untimed and self._frames:
            return (
                f"{self._untimed} of {self._frames} frames have no time in the file: nobody knows if they came evenly"
            )
        if len(self._ticks) < 3:
            return ""
        ticks = np.frombuffer(self._ticks, np.int64) - self._ticks[0]
        steps = np.frombuffer(self._numbers, np.int64) - self._numbers[0]
        period = max(float(ticks[-1]) / int(steps[-1]), 1e-9)
        if self.file_rate_hz is not None and self._tick_s and abs(self.file_rate_hz / self._rate_hz - 1) <= _OTHER_RATE:
            period = 1.0 / (self._rate_hz * self._tick_s)
        off = ticks - period * steps
        worst = int(np.abs(off).argmax())
        size = abs(off[worst])
        if size <= 1:  # the file rounds to whole ticks
            return ""
        return (
            f"its frames do not come evenly: frame {self._numbers[worst]} is {size * self._tick_s * 1e3:.1f} ms "
            f"({size / period:.2f} frames) {'later' if off[worst] > 0 else 'sooner'} than the rate says, by the times "
            "in the file; pulses are told by frame numbers all the same"
        )


@contextmanager
def _opened(path: Path) -> Iterator[tuple[InputContainer, VideoStream]]:
    """A video file and its first video stream.

    Raises:
        BadInputError: it cannot be read, or is no video.
    """
    try:
        file = open_to_read(path, links=True)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check the name and its permissions") from error
    with file:
        try:
            container = av.open(file, "r", options=_OWN_FILE_ONLY)
        except (FFmpegError, ValueError) as error:
            raise BadInputError(
                f"{path}: is no video that can be read ({error}); copy it again, or convert it"
            ) from None
        with container:
            if not container.streams.video:
                raise BadInputError(f"{path}: holds no video; name another file")
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            yield container, stream


def _decoded(container: InputContainer, stream: VideoStream) -> Iterator[VideoFrame]:
    yield from container.decode(stream)


def _duration_s(container: InputContainer, stream: VideoStream) -> float | None:
    if stream.duration is not None and stream.time_base is not None:
        return float(stream.duration * stream.time_base)
    return None if container.duration is None else container.duration / av.time_base


def _date(metadata: Mapping[str, str]) -> UtcNs | None:
    """When a video was begun, as its metadata say, UTC; None: they do not, or not in which time zone."""
    text = metadata.get("creation_time", "")
    if not re.search(r"(Z|[+-]\d\d:?\d\d)$", text):
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    seconds = (moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds()
    return UtcNs(round(seconds * NS_PER_S)) if seconds > 0 else None


def _remarks(frame: VideoFrame) -> Iterator[str]:
    if frame.interlaced_frame:
        yield (
            "its frames are interlaced: odd and even rows were taken half a frame apart; measure nothing that moves, "
            "or import each half as a frame of its own"
        )
    if frame.rotation:
        yield f"the file asks to be shown turned by {frame.rotation} degrees; frames are taken as the camera gave them"
