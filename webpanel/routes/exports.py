"""Routes that export recordings: ask for a video, pictures or a table, look how far it is, fetch it."""

from http import HTTPStatus
from typing import Annotated, Final

from fastapi import Path
from fastapi.responses import FileResponse

from rig.api.export import ExportJob, ExportOrder
from webpanel.routes.common import CHANGING, RecordingId, Responses, refusals, strict_router
from webpanel.routes.dependencies import A_DOWNLOAD, Service
from webpanel.routes.files import attachment

ExportId = Annotated[str, Path(pattern="^[0-9]{1,18}$", description="id of an export", examples=["1"])]
_FILE: Final[Responses] = {
    200: {
        "description": "The file.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}

router = strict_router("Exports")


@router.post(
    "/recordings/{recording_id}/exports", status_code=HTTPStatus.ACCEPTED, responses=CHANGING | refusals(404, 507)
)
def start_export(service: Service, recording_id: RecordingId, order: ExportOrder) -> ExportJob:
    """Ask for a video (H.264, or FFV1 without loss), a ZIP archive of pictures, a table or a contact sheet.

    Exports are made one after the other with the lowest priority, and stand still while a recording runs: their
    state is `paused` then. Ask for `GET /exports/{export_id}` until the state is `done` or `failed`.
    """
    return service.start_export(recording_id, order)


@router.get("/exports")
def list_exports(service: Service) -> list[ExportJob]:
    """All exports, newest first. They are removed after a day, sooner if their room is needed."""
    return service.exports.jobs()


@router.get("/exports/{export_id}", responses=refusals(404))
def get_export(service: Service, export_id: ExportId) -> ExportJob:
    """How far an export is."""
    return service.exports.job(export_id)


@router.delete("/exports/{export_id}", responses=CHANGING | refusals(404))
def remove_export(service: Service, export_id: ExportId) -> ExportJob:
    """Remove an export and its file; one that is not done is given up."""
    return service.exports.remove(export_id)


@router.get(
    "/exports/{export_id}/file",
    response_class=FileResponse,
    dependencies=[A_DOWNLOAD],
    responses=_FILE | refusals(404, 409, 503),
)
def download_export(service: Service, export_id: ExportId) -> FileResponse:
    """The file of an export that is done, whole or by a `Range`."""
    job, file = service.exports.job(export_id), service.exports.file(export_id)
    headers = {"Content-Disposition": attachment(job.name)}
    return FileResponse(file, headers=headers, media_type="application/octet-stream")
