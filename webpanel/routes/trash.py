"""The routes of the trash: how much lies in it, and removing it for good."""

from fastapi import APIRouter

from rig.api.recordings import Trash
from service.seam.rig import RigService
from webpanel.routes.common import CHANGING, RecordingId, refusals, strict_router
from webpanel.routes.events import Changes


def trash_router(service: RigService, changes: Changes) -> APIRouter:
    """The routes of the trash."""
    router = strict_router("Recordings")

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

    return router
