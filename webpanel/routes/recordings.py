"""The routes of recordings: start and stop, list, change, delete and restore."""

from http import HTTPStatus
from typing import Annotated, Final

from fastapi import APIRouter, Body, Query, Response

from rig.status import Recording, RecordingOrder, SessionChange, StopOrder, Trash
from service.seam import RigService
from webpanel.routes.common import CHANGING, NoFields, RecordingId, refusals, strict_router
from webpanel.routes.events import Changes

_ALL_HELD: Final = RecordingOrder()
_ORDER: Final = Body(
    openapi_examples={
        "a jump": {"value": {"athlete": "Ola Nordmann", "bib": "17", "gate": "12", "duration_s": 10}},
        "what has just happened": {"value": {"bib": "17", "preroll_s": 5, "duration_s": 0}},
    }
)
_LOCATED: Final = {"headers": {"Location": {"description": "address of the recording", "schema": {"type": "string"}}}}


def recordings_router(service: RigService, changes: Changes) -> APIRouter:
    """The routes that start, list and change recordings."""
    router = strict_router("Recordings")

    @router.post("/recordings", status_code=HTTPStatus.CREATED, responses=CHANGING | {201: _LOCATED})
    def start_recording(response: Response, order: Annotated[RecordingOrder, _ORDER] = _ALL_HELD) -> Recording:
        """Start a recording. The rig must be armed and not be recording already.

        It is of the next jumper, unless `bib` or `athlete` says of whom: then nothing else is filled in, and the next
        jumper stays the next one.

        If `preroll_s` is left out, the recording begins with all seconds that are held in memory; if `duration_s` is
        left out, it lasts until it is stopped. `{"duration_s": 0}` saves what has just happened, and ends by itself.
        """
        recording = service.start_recording(order)
        response.headers["Location"] = f"/api/recordings/{recording.id}"
        return recording

    @router.post("/recordings/{recording_id}/stop", responses=CHANGING | refusals(404))
    def stop_recording(recording_id: RecordingId, order: StopOrder | None = None) -> Recording:
        """Stop a recording; answers when its file is closed. A recording that has ended is not changed.

        A page sends `seen`, so that a second tap on its button does not end a recording that has only just begun.
        """
        return service.stop_recording(recording_id, order or StopOrder())

    @router.get("/recordings")
    def list_recordings(
        *, deleted: Annotated[bool, Query(description="those in the trash instead")] = False
    ) -> list[Recording]:
        """All recordings, newest first."""
        return service.recordings(deleted=deleted)

    @router.get("/recordings/{recording_id}", responses=refusals(404))
    def get_recording(recording_id: RecordingId) -> Recording:
        """One recording, in the trash or not."""
        return service.recording(recording_id)

    @router.patch("/recordings/{recording_id}", responses=CHANGING | refusals(404))
    def change_recording(recording_id: RecordingId, change: SessionChange) -> Recording:
        """Change session fields; those that are left out stay as they are. The log itself is not changed."""
        recording = service.change_session(recording_id, change)
        changes.recordings_changed()
        return recording

    @router.delete("/recordings/{recording_id}", responses=CHANGING | refusals(404))
    def delete_recording(recording_id: RecordingId) -> Recording:
        """Put a recording into the trash. If the trash holds this id already, the answer gives the new id."""
        recording = service.delete_recording(recording_id)
        changes.recordings_changed()
        return recording

    @router.get("/trash")
    def get_trash() -> Trash:
        """How much lies in the trash. What lies there: `GET /recordings?deleted=true`."""
        return service.trash()

    @router.delete("/trash", responses=CHANGING)
    def empty_trash() -> Trash:
        """Empty the trash: what was deleted is removed for good, which frees its room. Answers what was removed."""
        gone = service.empty_trash()
        changes.recordings_changed()
        return gone

    @router.delete("/trash/{recording_id}", responses=CHANGING | refusals(404))
    def remove_recording(recording_id: RecordingId) -> Trash:
        """Remove one recording for good; it must lie in the trash."""
        gone = service.remove_recording(recording_id)
        changes.recordings_changed()
        return gone

    @router.post("/recordings/{recording_id}/restore", responses=CHANGING | refusals(404))
    def restore_recording(recording_id: RecordingId, _: NoFields = None) -> Recording:
        """Take a recording out of the trash. If another recording has its id by now, the answer gives the new id."""
        recording = service.restore_recording(recording_id)
        changes.recordings_changed()
        return recording

    return router
