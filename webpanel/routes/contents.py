"""Routes that look into a recording: its pulses, its images, notes about them, written and spoken."""

from functools import partial
from http import HTTPStatus
from typing import Annotated, Final

import cv2
import numpy as np
from anyio.to_thread import run_sync
from fastapi import Path, Query, Request, Response
from numpy.typing import NDArray

from rig.api.looking import Moment, NewNote, Note, VoiceNote
from rig.api.recordings import Pulses, RecordingState
from service.seam.rig import RigService
from webpanel.door.guard import ANY_BYTES
from webpanel.previews import to_jpeg
from webpanel.problems import ProblemError
from webpanel.routes.common import CHANGING, RecordingId, Responses, jpeg_answer, refusals, strict_router
from webpanel.routes.dependencies import Service, TheChanges, TheThreads, TheThumbnails
from webpanel.routes.files import attachment

_THUMBNAIL_WIDTH = 480
#: An image of a closed log never changes.
_KEPT = {"Cache-Control": "private, max-age=31536000, immutable"}
Pulse = Annotated[int, Path(ge=1, le=2**53, description="number of the pulse", examples=[1])]
NotedPulse = Annotated[int, Query(ge=1, le=10**15, description="number of the pulse", examples=[1])]
VoiceNumber = Annotated[int, Path(ge=1, le=999_999, description="number of the note", examples=[1])]
OneCamera = Annotated[str | None, Query(max_length=100, description="only this camera", examples=["K2"])]
OfferAsFile = Annotated[bool, Query(description="offer it as a file to keep")]
_WEBM: Final = "audio/webm"
_SOUND: Final = {_WEBM: {"schema": {"type": "string", "format": "binary"}}}
_HEARD: Responses = {200: {"description": "The sound.", "content": _SOUND}}
_PNG: Responses = {
    200: {
        "description": "The triplet, or one camera's part of it.",
        "content": {"image/png": {"schema": {"type": "string", "format": "binary"}}},
    }
}

router = strict_router("Recordings")


@router.get("/recordings/{recording_id}/pulses", responses=refusals(404))
async def list_pulses(service: Service, threads: TheThreads, recording_id: RecordingId) -> Pulses:
    """What became of each pulse in each camera."""
    return await run_sync(service.pulses, recording_id, limiter=threads.reading)


@router.get(
    "/recordings/{recording_id}/pulses/{pulse}.jpg",
    response_class=Response,
    responses=jpeg_answer("The triplet, or one camera's part of it.") | refusals(404),
)
async def get_image(
    service: Service,
    threads: TheThreads,
    recording_id: RecordingId,
    pulse: Pulse,
    camera: OneCamera = None,
    width: Annotated[int | None, Query(ge=16, le=8192, description="at most so many columns")] = None,
) -> Response:
    """One triplet of a recording, the cameras side by side."""
    jpeg = await run_sync(_jpeg, service, recording_id, pulse, camera, width, limiter=threads.reading)
    return Response(jpeg, media_type="image/jpeg", headers=_KEPT)


@router.get(
    "/recordings/{recording_id}/pulses/{pulse}.png",
    response_class=Response,
    responses=_PNG | refusals(404),
)
async def get_whole_image(
    service: Service,
    threads: TheThreads,
    recording_id: RecordingId,
    pulse: Pulse,
    camera: OneCamera = None,
    download: OfferAsFile = False,
) -> Response:
    """The same without loss: every pixel is that of the log."""
    png = await run_sync(_png, service, recording_id, pulse, camera, limiter=threads.reading)
    name = f"{recording_id}_{pulse}{'' if camera is None else '_' + camera}.png"
    offered = {"Content-Disposition": attachment(name)} if download else {}
    return Response(png, media_type="image/png", headers=_KEPT | offered)


@router.get("/recordings/{recording_id}/moment", responses=refusals(404))
async def get_moment(
    service: Service,
    threads: TheThreads,
    recording_id: RecordingId,
    jump: Annotated[int, Query(ge=1, le=100_000, description="number of the jump, of several measured ones")] = 1,
    by_motion: Annotated[bool, Query(description="where most moves, even if the take-off was measured")] = False,
) -> Moment:
    """The pulse at which to open a recording: the take-off if the jump was measured, otherwise where most moves."""
    return await run_sync(
        partial(service.moment, jump=jump, by_motion=by_motion), recording_id, limiter=threads.reading
    )


@router.get(
    "/recordings/{recording_id}/thumbnail.jpg",
    response_class=Response,
    responses=jpeg_answer("A triplet in which most moves, 480 columns wide.") | refusals(404),
)
async def get_thumbnail(
    service: Service, threads: TheThreads, thumbnails: TheThumbnails, recording_id: RecordingId
) -> Response:
    """A small picture of a recording."""
    recording = await run_sync(service.recording, recording_id, limiter=threads.reading)
    final = recording.state is RecordingState.FINISHED
    key = recording.id, recording.bytes, recording.started
    if (jpeg := thumbnails.find(key)) is None:
        jpeg = await run_sync(_thumbnail, service, recording_id, limiter=threads.reading)
    if final:
        thumbnails.keep(key, jpeg)
    return Response(jpeg, media_type="image/jpeg", headers=_KEPT if final else None)


@router.get("/recordings/{recording_id}/notes", responses=refusals(404))
def list_notes(service: Service, recording_id: RecordingId) -> list[Note]:
    """The notes at single pulses, in order."""
    return service.notes(recording_id)


@router.put("/recordings/{recording_id}/notes/{pulse}", responses=CHANGING | refusals(404))
def set_note(
    service: Service, changes: TheChanges, recording_id: RecordingId, pulse: Pulse, note: NewNote
) -> list[Note]:
    """Note something at a pulse, in place of what was noted there; the log itself is not changed."""
    notes = service.note(recording_id, pulse, note.text)
    changes.recordings_changed()
    return notes


@router.delete("/recordings/{recording_id}/notes/{pulse}", responses=CHANGING | refusals(404))
def remove_note(service: Service, changes: TheChanges, recording_id: RecordingId, pulse: Pulse) -> list[Note]:
    """Remove the note of a pulse; if it has none, nothing changes."""
    notes = service.note(recording_id, pulse, "")
    changes.recordings_changed()
    return notes


@router.get("/recordings/{recording_id}/voice-notes", responses=refusals(404))
def list_voice_notes(service: Service, recording_id: RecordingId) -> list[VoiceNote]:
    """The spoken notes, in the order in which they were spoken."""
    return service.voice_notes(recording_id)


@router.post(
    "/recordings/{recording_id}/voice-notes",
    status_code=HTTPStatus.CREATED,
    responses=CHANGING | refusals(404),
    openapi_extra={"requestBody": {"required": True, "content": _SOUND | {ANY_BYTES: _SOUND[_WEBM]}}},
)
async def add_voice_note(
    service: Service, changes: TheChanges, recording_id: RecordingId, pulse: NotedPulse, request: Request
) -> list[VoiceNote]:
    """Keep a spoken note about a pulse: a WebM file of at most 2 MiB, in a folder beside the log.

    It goes to the trash and back with the recording, and stands in archives of recordings.
    """
    if not request.headers.get("content-type", "").startswith((_WEBM, ANY_BYTES)):
        text = f"the body must be sound: send Content-Type: {_WEBM}"
        raise ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", text)
    notes = await run_sync(service.add_voice_note, recording_id, pulse, await request.body())
    changes.recordings_changed()
    return notes


@router.get(
    "/recordings/{recording_id}/voice-notes/{number}/sound.webm",
    response_class=Response,
    responses=_HEARD | refusals(404),
)
def get_voice_note(
    service: Service, recording_id: RecordingId, number: VoiceNumber, download: OfferAsFile = False
) -> Response:
    """A spoken note, to listen to."""
    file = service.voice_file(recording_id, number)
    with file.open() as opened:
        sound = opened.read()
    offered = {"Content-Disposition": attachment(file.name)} if download else {}
    return Response(sound, media_type=_WEBM, headers=offered)


@router.delete("/recordings/{recording_id}/voice-notes/{number}", responses=CHANGING | refusals(404))
def remove_voice_note(
    service: Service, changes: TheChanges, recording_id: RecordingId, number: VoiceNumber
) -> list[VoiceNote]:
    """Remove a spoken note for good; if there is none of this number, nothing changes."""
    notes = service.remove_voice_note(recording_id, number)
    changes.recordings_changed()
    return notes


def _jpeg(service: RigService, recording_id: str, pulse: int, camera: str | None, width: int | None) -> bytes:
    """One triplet, or one camera's part of it, encoded."""
    image = service.image(recording_id, pulse)
    return to_jpeg(image if camera is None else _block(service.pulses(recording_id), image, camera), width)


def _png(service: RigService, recording_id: str, pulse: int, camera: str | None) -> bytes:
    """The same as PNG."""
    image = service.image(recording_id, pulse)
    _, png = cv2.imencode(".png", image if camera is None else _block(service.pulses(recording_id), image, camera))
    return png.tobytes()


def _block(pulses: Pulses, image: NDArray[np.uint8], camera: str) -> NDArray[np.uint8]:
    """One camera's columns of a triplet."""
    if camera not in pulses.cameras:
        known = ", ".join(pulses.cameras)
        raise ProblemError(HTTPStatus.NOT_FOUND, "unknown_camera", f"no camera of this name: choose among {known}")
    first, end = pulses.columns[pulses.cameras.index(camera)]
    return np.ascontiguousarray(image[:, first:end])


def _thumbnail(service: RigService, recording_id: str) -> bytes:
    """The triplet that shows the recording best, small."""
    return _jpeg(service, recording_id, service.liveliest_pulse(recording_id), None, _THUMBNAIL_WIDTH)
