"""Recordings: start and stop, list, change, delete and restore."""

from http import HTTPStatus
from typing import Annotated, Final

from fastapi import APIRouter, Body, Path, Query, Response

from recorder.catalogue import Catalogue
from webpanel.api_errors import CHANGING, refusals
from webpanel.changes import Changes
from webpanel.models import Nothing, Recording, RecordingOrder, SessionChange
from webpanel.recording_view import to_recording
from webpanel.rig_service import RigService
from webpanel.strict_route import strict_router

RecordingId = Annotated[
    str,
    Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]{0,99}$", description="id of a recording", examples=["20260214-101530"]),
]
NoFields = Annotated[Nothing | None, Body(description="nothing, or an empty object")]

_ALL_HELD: Final = RecordingOrder()
_ORDER: Final = Body(
    openapi_examples={
        "a jump": {"value": {"athlete": "Ola Nordmann", "bib": "17", "gate": "12", "duration_s": 10}},
        "what has just happened": {"value": {"bib": "17", "preroll_s": 5, "duration_s": 0}},
    }
)
_LOCATED: Final = {"headers": {"Location": {"description": "address of the recording", "schema": {"type": "string"}}}}


def recordings_router(service: RigService, catalogue: Catalogue, changes: Changes) -> APIRouter:
    """The routes that start, list and change recordings."""
    router = strict_router("Recordings")

    @router.post("/recordings", status_code=HTTPStatus.CREATED, responses=CHANGING | {201: _LOCATED})
    def start_recording(response: Response, order: Annotated[RecordingOrder, _ORDER] = _ALL_HELD) -> Recording:
        """Start a recording. The rig must be armed, and one recording at a time: two calls are two orders, not one.

        Left out, `preroll_s` is all that is held in memory and `duration_s` is until stopped.
        `{"duration_s": 0}` saves what has just happened, and ends by itself.
        """
        recording = service.start_recording(order)
        response.headers["Location"] = f"/api/recordings/{recording.id}"
        return recording

    @router.post("/recordings/{recording_id}/stop", responses=CHANGING | refusals(404))
    def stop_recording(recording_id: RecordingId, _: NoFields = None) -> Recording:
        """Stop a recording; answers when its file is closed. One that has ended stays as it is."""
        return service.stop_recording(recording_id)

    @router.get("/recordings")
    def list_recordings(
        *, deleted: Annotated[bool, Query(description="those in the trash instead")] = False
    ) -> list[Recording]:
        """All recordings, newest first."""
        current = service.status().recording
        found = [to_recording(entry) for entry in catalogue.entries(deleted=deleted)]
        return [current if current and each.id == current.id else each for each in found]

    @router.get("/recordings/{recording_id}", responses=refusals(404))
    def get_recording(recording_id: RecordingId) -> Recording:
        """One recording, in the trash or not."""
        current = service.status().recording
        return current if current and current.id == recording_id else to_recording(catalogue.entry(recording_id))

    @router.patch("/recordings/{recording_id}", responses=CHANGING | refusals(404))
    def change_recording(recording_id: RecordingId, change: SessionChange) -> Recording:
        """Change session fields; those that are left out stay. The log itself is not touched."""
        recording = service.change_session(recording_id, change)
        changes.recordings_changed()
        return recording

    @router.delete("/recordings/{recording_id}", responses=CHANGING | refusals(404))
    def delete_recording(recording_id: RecordingId) -> Recording:
        """Put a recording into the trash. If the trash has one of this id, the answer says what id it has got there."""
        recording = service.delete_recording(recording_id)
        changes.recordings_changed()
        return recording

    @router.post("/recordings/{recording_id}/restore", responses=CHANGING | refusals(404))
    def restore_recording(recording_id: RecordingId, _: NoFields = None) -> Recording:
        """Take a recording out of the trash. If its id was taken meanwhile, the answer says what id it has got."""
        recording = service.restore_recording(recording_id)
        changes.recordings_changed()
        return recording

    return router
