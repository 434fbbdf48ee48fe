"""Checks the messages of a log: tags against each other, images against their tags, events, health."""

from collections.abc import Callable

import msgspec

from recorder.reading.items import Chunk, Message
from recorder.reading.triplets import (
    ImageView,
    camera_images_of,
    event_of,
    health_of,
    images_of,
    is_json,
    pixels,
    read_tag,
    view_image,
)
from rig.clocks import UtcNs
from rig.events import Event
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.jumper import JumperState
from rig.tag import CameraTag, TripletTag
from rig.topics import CAMERA_TOPIC, EVENTS, HEALTH, JUMPER, TAG, TRIPLET
from triggering.ledger.account import Ledger
from triggering.ledger.recount import Recount

_EVENTS_MAX = 1000


class _Said(msgspec.Struct):
    """What a tag says of itself."""

    complete: bool


class PulseCheck:
    """Checks chunk after chunk, in the order of the log; only chunks without a flaw.

    Args:
        report: called with each finding.

    Attributes:
        ledger: what became of every pulse, as the tags say.
        recount: the same, recomputed.
        events: the events, the first thousand.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self.ledger, self.recount = Ledger(), Recount()
        self.events: list[Event] = []
        self._report = report
        self._cameras: tuple[object, ...] | None = None
        self._without_image: dict[int, TripletTag] = {}

    def take(self, chunk: Chunk) -> None:
        """Check a chunk's messages. A tag must stand before its image, in the same chunk or an earlier one."""
        cameras = camera_images_of(chunk)
        images = images_of(chunk) if cameras else {}
        for message in chunk.messages:
            match message.topic:
                case TAG.name:
                    self._tag(message)
                case TRIPLET.name:
                    self._image(message)
                case topic if topic.startswith(CAMERA_TOPIC) and message.sequence in cameras:
                    self._camera_images(cameras.pop(message.sequence), images.get(message.sequence))
                case EVENTS.name:
                    self._event(message)
                case HEALTH.name:
                    self._health(message)
                case JUMPER.name:
                    self._jumper(message)

    def finish(self) -> None:
        """Report what can be known only at the end of the log: images that never came, pulses out of order."""
        for pulse, tag in self._without_image.items():
            if any(camera.status is FrameStatus.OK for camera in tag.cameras):
                self._report(f"pulse {pulse}: its tag says that frames came, but there is no image")
        for pulse in self.ledger.out_of_order:
            self._report(f"pulse {pulse}: tagged a second time, or out of order")

    def _tag(self, message: Message) -> None:
        try:
            data = bytes(message.data or b"")
            tag = read_tag(data)
            says_complete = msgspec.json.decode(data, type=_Said).complete
        except ValueError as error:
            self._report(f"pulse {message.sequence}: its tag cannot be read ({error})")
            return
        if flaw := self._tag_flaw(tag, message, says_complete):
            self._report(f"pulse {tag.pulse}: {flaw}")
        self.ledger.add(tag)
        self.recount.add(tag)
        self._without_image[tag.pulse] = tag

    def _tag_flaw(self, tag: TripletTag, message: Message, says_complete: object) -> str:
        cameras = tuple((camera.name, camera.columns, camera.rows) for camera in tag.cameras)
        self._cameras = self._cameras or cameras
        earlier = self.ledger.last_time
        blocks = [camera.columns for camera in tag.cameras]
        flaws = (
            (tag.pulse != message.sequence, f"its tag stands in the message of pulse {message.sequence}"),
            (tag.time != message.publish_time, "the time in its tag is not that of its message"),
            (says_complete is not tag.complete, 'its tag says "complete", its cameras say otherwise'),
            (cameras != self._cameras, "its tag names other cameras or columns than the first tag of the log"),
            (
                not _side_by_side(blocks, tag.shape[1]),
                "its cameras' columns do not lie side by side over the whole width",
            ),
            (earlier is not None and tag.time <= earlier, "it is not later than the pulse before it"),
        )
        return next((text for wrong, text in flaws if wrong), "")

    def _image(self, message: Message) -> None:
        tag = self._without_image.pop(message.sequence, None)
        try:
            image = view_image(message.data or memoryview(b""))
        except ValueError as error:
            self._report(f"pulse {message.sequence}: its image cannot be read ({error})")
            return
        flaw = "it has an image, but no tag before it" if tag is None else _image_flaw(image, tag, message.publish_time)
        if flaw:
            self._report(f"pulse {message.sequence}: {flaw}")

    def _camera_images(self, messages: list[Message], triplet: Message | None) -> None:
        """Check the images of a pulse's cameras, left to right, and the triplet that they make."""
        pulse = messages[0].sequence
        tag = self._without_image.get(pulse)
        if triplet is None:
            self._report(f"pulse {pulse}: the images of its cameras cannot be read, or do not fit together")
            return
        if tag is not None:
            said = [(CAMERA_TOPIC + camera.name, camera.columns[1] - camera.columns[0]) for camera in tag.cameras]
            found = [(message.topic, view_image(message.data or memoryview(b"")).columns) for message in messages]
            if found != said:
                self._report(f"pulse {pulse}: its images are not those of the cameras in its tag")
        self._image(triplet)

    def _event(self, message: Message) -> None:
        event = event_of(message)
        if event is None:
            self._report(f"event {message.sequence}: cannot be read")
            return
        self.recount.happened(event)
        if len(self.events) < _EVENTS_MAX:
            self.events.append(event)

    def _health(self, message: Message) -> None:
        if not is_json(message.data or b""):
            self._report(f"health record {message.sequence}: cannot be read")
        elif (health := health_of(message)) is not None:
            self.recount.reported(health, message.log_time)

    def _jumper(self, message: Message) -> None:
        try:
            pulse = JumperState.decode(message.data or b"").pulse
        except ValueError as error:
            self._report(f"jumper at pulse {message.sequence}: cannot be read ({error})")
            return
        if pulse != message.sequence:
            self._report(f"jumper at pulse {pulse}: stands in the message of pulse {message.sequence}")


def _side_by_side(columns: list[tuple[int, int]], width: int) -> bool:
    """Whether the blocks of columns, (first, end), cover the width once, left to right."""
    ends = [0, *(end for _, end in columns)]
    return ends[-1] == width and all(first == end < last for end, (first, last) in zip(ends, columns, strict=False))


def _image_flaw(image: ImageView, tag: TripletTag, publish_time: UtcNs) -> str:
    if (image.rows, image.columns) != tag.shape:
        return f"its image is {image.rows} x {image.columns}, its tag says {tag.shape[0]} x {tag.shape[1]}"
    try:
        everything = pixels(image)
    except ValueError as error:
        return str(error)
    if image.time != tag.time or image.time != publish_time:
        return "the time in its image is not that of its tag"
    if image.encoding != tag.pixels.encoding:
        return f'its image is "{image.encoding}", its tag says "{tag.pixels.encoding}"'
    return next((flaw for camera in tag.cameras if (flaw := _block_flaw(everything, camera))), "")


def _block_flaw(image: Stored, camera: CameraTag) -> str:
    """What is not black in a triplet, (rows, columns), though no frame of the camera is there."""
    _, rows = camera.size((image.shape[0], image.shape[1]))
    block = image[:, slice(*camera.columns)]
    if camera.status is not FrameStatus.OK:
        return f"{camera.name} is {camera.status.value}, but its block of the image is not black" if block.any() else ""
    return f"{camera.name} has {rows} rows, but what is below them is not black" if block[rows:].any() else ""
